import html
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interfaces.reports.motion import Motion, motion_of_demonstration, motion_of_run
from interfaces.reports.page_template import script_value
from interfaces.reports.replay_page import replay_page
from interfaces.reports.replay_scene import arrow_scale, draw_scene, viewer_source
from tests.browser import blankness, open_page
from tests.trajectories import STATE_NAMES, make_demonstration, make_rig_run


@pytest.fixture
def write_page(tmp_path: Path) -> Callable[..., Path]:
    """Writes the page of a motion and returns its path."""

    def write(motion: Motion, **options: Any) -> Path:
        path = tmp_path / "page.html"
        path.write_text(replay_page(motion, **{"title": "page", **options}))
        return path

    return write


@pytest.mark.browser
@pytest.mark.slow
def test_page_of_a_rig_run_shows_the_scene_and_the_sample_at_a_time(write_page):
    samples = make_rig_run().samples
    page = write_page(motion_of_run(make_rig_run()))
    with open_page(page, fragment="#t=0.5") as browser:
        browser.wait("window.replay && replay.ready && document.querySelector('.now')")
        for time in (0.5, 1.01, 1.999):
            browser.run("replay.seek(arguments[0])", time)
            browser.wait(f"document.getElementById('reading-time').textContent === '{time:.2f} s'")
            row = samples[samples["time"] <= time + 1e-6].iloc[-1]
            text = browser.run("return document.getElementById('card').innerText")
            now = browser.run("return [...document.querySelectorAll('.now')].map(e => e.children[1].textContent)")
            assert now == [STATE_NAMES[int(row["state"])]]
            assert f"{-1e3 * row['tip_z']:.2f} mm" in text
            assert f"{row['fz']:.1f} N" in text
            load = np.hypot(np.linalg.norm(row[["fx", "fy", "fz"]]), np.linalg.norm(row[["mx", "my", "mz"]]) / 0.01)
            assert f"{load:.1f} of 50 N" in text
            bar = browser.run("return parseFloat(document.querySelector('#load-bar div').style.width)")
            assert bar == pytest.approx(2 * load, abs=0.01)
            assert f"{row['pitch_taken']:.0f}, {row['yaw_taken']:.0f}" in text
            peg = browser.run(
                "const o = viewer.scene_tree.find(['meshcat', 'peg']).object;"
                "const c = viewer.scene_tree.find(['meshcat', 'peg', 'body', '<object>']).object.material.color;"
                "return [o.position.x, o.position.y, o.position.z, '#' + c.getHexString().toUpperCase()]"
            )
            tip_z = np.interp(time, samples["time"], samples["tip_z"])
            assert peg[:3] == pytest.approx([0, 0, tip_z], abs=1e-8)
            motion = motion_of_run(make_rig_run())
            assert peg[3] == motion.colours[int(row["state"])]
        text = browser.run("return document.body.innerText")
        for name in (
            *STATE_NAMES,
            "moment on the peg, 10 mm",
            "force on the peg, 10 mm",
            "back-off",
            "rig run: inserted",
        ):
            assert name in text
        picture = browser.screenshot()
        content = blankness(picture)
        assert content.colours > 60
        assert content.drawn > 0.1
        view = blankness(picture[100:-140, 320:-320])  # the scene between the panels
        assert view.colours > 20
        assert view.drawn > 0.15
        assert browser.requests() == []
        assert browser.errors() == []


@pytest.mark.browser
@pytest.mark.nightly
def test_page_of_a_run_lists_the_states_that_never_occur(write_page):
    motion = motion_of_run(make_rig_run(state_names=[*STATE_NAMES, "never seen"]))
    with open_page(write_page(motion)) as browser:
        browser.wait("window.replay && replay.ready && document.querySelector('.now')")
        assert browser.run("return document.querySelectorAll('#phases > div').length") == len(STATE_NAMES)
        assert "never: never seen" in browser.run("return document.getElementById('card').innerText")


@pytest.mark.browser
@pytest.mark.nightly
def test_page_of_a_demonstration_plays_to_its_end(write_page):
    with open_page(write_page(motion_of_demonstration(make_demonstration()), speed=8)) as browser:
        browser.wait("window.replay && replay.time() >= replay.end - 1e-6")
        first = browser.screenshot()
        quaternion = browser.run("return viewer.scene_tree.find(['meshcat', 'peg']).object.quaternion.toArray()")
        last = motion_of_demonstration(make_demonstration()).R_WP[-1].as_quat()
        np.testing.assert_allclose(quaternion, last, atol=1e-6)
        browser.wait("document.getElementById('play').textContent === 'play'")
        assert browser.run("return document.querySelectorAll('.rig').length") == 0
        browser.run("document.getElementById('play').click(); replay.pause(); replay.seek(0)")
        browser.wait("document.getElementById('reading-time').textContent === '0.00 s'")
        assert browser.run("return document.getElementById('reading-tilt').textContent") == "2.50 °"
        changed = np.abs(browser.screenshot().astype(int) - first).max(axis=2) > 24
        assert changed.mean() > 0.01
        assert browser.requests() == []
        assert browser.errors() == []


@pytest.mark.browser
@pytest.mark.slow
def test_arrow_has_the_direction_and_the_length_of_the_force(write_page):
    motion = motion_of_demonstration(make_demonstration())
    k = int(np.linalg.norm(motion.force, axis=1).argmax())
    with open_page(write_page(motion), fragment=f"#t={motion.time[k]}") as browser:
        browser.wait("window.replay && replay.ready")
        browser.wait(f"Math.abs(replay.time() - {motion.time[k]}) < 1e-6")
        end = browser.run(
            "viewer.scene.updateMatrixWorld(true);"
            "const head = viewer.scene_tree.find(['meshcat', 'force', 'head', 'cone0']).object;"
            "return head.parent.localToWorld(head.position.clone().setZ(0.004)).toArray()"
        )
    # In the world of the viewer, y points upwards.
    end_W = np.array([end[0], -end[2], end[1]])
    expected = motion.p_WP[k] + motion.R_WP[k].apply(motion.force[k]) / arrow_scale(motion).force
    np.testing.assert_allclose(end_W, expected, atol=1e-6)


@pytest.mark.parametrize("title", ['</script><b>sly & quoted"', "<!--<script>", "$data ${script} $"])
def test_page_is_self_contained_and_shows_any_title_as_text(title):
    page = replay_page(motion_of_demonstration(make_demonstration()), title=title)
    head = page[: page.index("<script>")]
    for outside in ("<script src", '<link rel="stylesheet', "@import", 'src="http', 'href="http'):
        assert outside not in head
    assert page.count("</script>") == 2
    data = page[page.index("const data = ") + len("const data = ") :].split(";\n", 1)[0]
    assert json.loads(data)["title"] == title
    assert f"<title>{html.escape(title)}</title>" in page
    assert "<!--" not in page[page.index("const data = ") :]


# -------------------------------------------------------------- data of the page


def data_of(page: str) -> dict[str, Any]:
    """The constant `data` of the page's script."""
    return json.loads(page[page.index("const data = ") + len("const data = ") :].split(";\n", 1)[0])


def third_of_everything() -> Motion:
    """Two samples, with 1/3 of an SI unit for everything measured."""
    motion = motion_of_run(make_rig_run())
    third = np.full(3, 1 / 3)
    return replace(
        motion,
        time=np.array([0.0, 1 / 3]),
        R_WP=Rotation.from_rotvec([[0, 0, 0], [0, 1 / 3, 0]]),
        R_WH=Rotation.identity(2),
        force=np.array([0 * third, third]),
        moment=np.array([0 * third, third]),
        depth=np.array([0.0, 1 / 3]),
        contact_points=None,
        contact_forces=None,
        phase=np.array([0, 1]),
        back_off=np.array([False, True]),
        reversed=np.array([False, False]),
        steps=np.array([[0, 0], [3, 5]]),
    )


def test_readings_are_rounded_to_what_the_page_can_show():
    """1 us, 0.1 um, 0.1 urad, 0.1 mN and 0.1 uN m."""
    data = data_of(replay_page(third_of_everything(), title="t"))
    assert data["time"] == [0, 0.333333]
    assert data["depth"] == [0, 0.3333333]
    assert data["lean"] == [[0, 0], [0.3333333, 0]]
    assert data["force"] == [0, 0.5774]  # 1 / sqrt(3)
    assert data["moment"] == [0, 0.5773503]
    assert data["load"] == [0, 57.7379]  # sqrt((1 + 100^2) / 3), for a radius of 10 mm
    # The peg leans towards x: cos(1/3) = 0.944957 and sin(1/3) = 0.327195.
    assert data["lateral"] == [[0, 0], [0.4241, 0.3333]]
    assert data["axial"] == [0, 0.3333]  # along the peg


def test_page_holds_the_labels_and_the_steps_of_both_motors():
    data = data_of(replay_page(third_of_everything(), title="t", speed=2.0))
    assert (data["speed"], data["about"], data["limit"]) == (2, "rig run: inserted", 50)
    assert (data["phase"], data["phases"]) == ([0, 1], STATE_NAMES)
    assert data["back_off"] == [False, True]
    assert data["steps"] == [[0, 3], [0, 5]]
    assert (data["force_colour"], data["moment_colour"]) == ("#C1121F", "#6A1B9A")
    # The camera stands at x = 124 mm, y = 110 mm.
    assert np.tan(data["azimuth"]) == pytest.approx(110 / 124)
    assert 0 < data["azimuth"] < np.pi / 2


@pytest.mark.parametrize(
    ("force", "moment", "scales"),
    [
        (6.0, 0.06, ("2 N", "20 N mm")),  # arrows of 30 mm
        (30.0, 0.17, ("10 N", "50 N mm")),
        (30.0, 0.3, ("10 N", "0.1 N m")),
        (0.0, 0.0, ("0.5 N", "5 N mm")),
    ],
)
def test_legend_gives_what_an_arrow_of_10_mm_stands_for(force, moment, scales):
    motion = third_of_everything()
    motion = replace(motion, force=np.array([[0, 0, 0], [0, 0, force]]), moment=np.array([[0, 0, 0], [0, moment, 0]]))
    data = data_of(replay_page(motion, title="t"))
    assert (data["force_scale"], data["moment_scale"]) == scales


def test_the_contacts_share_the_scale_of_the_force_and_the_page_gives_their_sizes():
    motion = third_of_everything()
    forces = np.zeros((2, 3, 3))
    forces[1, 0], forces[1, 1] = [30.0, 0.0, 40.0], [-3.0, 0.0, 0.0]
    motion = replace(motion, contact_forces=forces, contact_points=np.zeros((2, 3, 3)))
    data = data_of(replay_page(motion, title="t"))
    assert data["contacts"] == [[0, 0, 0], [50, 3, 0]]
    assert data["force_scale"] == "20 N"  # 50 N are 25 mm


def test_page_of_a_run_marks_the_turns_that_were_reversed():
    run = make_rig_run()
    data = data_of(replay_page(motion_of_run(run), title="t"))
    assert data["reversed"] == (run.samples["turning"] < 0.0).tolist()
    assert any(data["reversed"])


def test_page_of_a_demonstration_holds_no_guard_and_no_steps():
    data = data_of(replay_page(motion_of_demonstration(make_demonstration()), title="t"))
    assert data["speed"] == 1
    assert [data["back_off"], data["reversed"], data["steps"], data["limit"]] == [None, None, None, None]


@pytest.mark.parametrize("speed", [0.0, -1.0, np.inf, np.nan])
def test_speed_that_is_not_a_finite_number_above_0_is_an_error(speed):
    with pytest.raises(ValueError, match="speed"):
        replay_page(third_of_everything(), title="t", speed=speed)


def test_page_contains_the_viewer_and_the_commands_of_the_scene():
    page = replay_page(third_of_everything(), title="t")
    assert viewer_source() in page
    assert script_value(draw_scene(third_of_everything()).commands_base64()[:2])[1:-1] in page
