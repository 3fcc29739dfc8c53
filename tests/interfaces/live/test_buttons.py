import pytest

from interfaces.live.buttons import BAD, GOOD, KEYS, QUIT, START, Buttons


class Clicks:
    """Replaces the controls; counts the clicks of its buttons."""

    def __init__(self):
        self.keys, self.counts = {}, {}

    def AddButton(self, label, key):
        self.keys[label] = key
        self.counts.setdefault(label, 2)  # clicks before

    def GetButtonClicks(self, label):
        return self.counts[label]


@pytest.fixture
def browser():
    return Clicks()


def test_every_click_is_handled_once_and_earlier_clicks_do_not_count(browser):
    dut = Buttons(browser)
    assert browser.keys == KEYS
    assert not any(dut.clicked(label) for label in KEYS)
    browser.counts[GOOD] += 1
    assert dut.clicked(BAD) is False
    assert dut.clicked(GOOD) is True
    assert dut.clicked(GOOD) is False


def test_one_of_several_buttons_is_waiting_until_its_click_is_handled(browser):
    dut = Buttons(browser)
    assert dut.any_waiting(GOOD, BAD) is False
    browser.counts[BAD] += 1
    assert dut.any_waiting(GOOD, BAD) is True
    assert dut.any_waiting(GOOD, QUIT) is False
    assert dut.any_waiting(GOOD, BAD) is True  # it still counts
    assert dut.clicked(BAD)
    assert dut.any_waiting(GOOD, BAD) is False


def test_forgotten_clicks_do_not_count(browser):
    dut = Buttons(browser)
    browser.counts[START] += 1
    browser.counts[QUIT] += 3
    dut.forget_clicks()
    assert not any(dut.clicked(label) for label in KEYS)


def test_clicks_of_one_button_can_be_forgotten(browser):
    dut = Buttons(browser)
    browser.counts[START] += 1
    browser.counts[QUIT] += 1
    dut.forget_clicks(START)
    assert dut.clicked(START) is False
    assert dut.clicked(QUIT) is True
