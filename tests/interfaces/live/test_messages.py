from interfaces.live.messages import Outbox


def test_a_new_reader_gets_the_latest_message_of_each_key_in_order():
    dut = Outbox()
    for key, content in (("a", b"1"), ("b", b"2"), ("a", b"3")):
        dut.put(key, content)
    assert dut.since(0) == (3, [b"2", b"3"])
    assert dut.since(2) == (3, [b"3"])
    assert dut.since(3) == (3, [])


def test_the_source_of_a_message_does_not_receive_it_but_another_message_of_the_key():
    dut = Outbox()
    dut.put("a", b"1", source=7)
    assert dut.since(0, reader=7) == (1, [])
    assert dut.since(0, reader=8) == (1, [b"1"])
    dut.put("a", b"2")
    assert dut.since(1, reader=7) == (2, [b"2"])
