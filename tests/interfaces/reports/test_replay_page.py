import html
import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interfaces.reports.motion import Motion, motion_of_demonstration, motion_of_run
from interfaces.reports.page_template import script_value
from interfaces.reports.replay_page import replay_page
from interfaces.reports.replay_scene import draw_scene, viewer_source
from tests.browser import blankness, open_page
from tests.trajectories import STATE_NAMES, make_demonstration, make_rig_run


@pytest.mark.browser
@pytest.mark.slow
def test_page_of_a_rig_run_shows_the_scene_and_the_sample_at_a_time_and_plays_to_the_end(tmp_path):
    run, path = make_rig_run(), tmp_path / "page.html"
    samples, motion = run.samples, motion_of_run(run)
    path.write_text(replay_page(motion, title="page", speed=8))
    data = data_of(path.read_text())
    with open_page(path, fragment="#t=0.5") as browser:
        browser.wait("window.replay && replay.ready && document.querySelector('.now')")
        for time in (0.5, 1.01, 1.999):
            browser.run("replay.seek(arguments[0])", time)
            browser.wait(f"document.getElementById('time').textContent === '{time:.2f} s'")
            k = int(np.searchsorted(samples["time"], time + 1e-6)) - 1
            state, row = int(samples["state"][k]), samples.loc[k]
            text = browser.run("return document.getElementById('card').innerText")
            now = browser.run("return [...document.querySelectorAll('.now')].map(e => e.children[1].textContent)")
            assert now == [STATE_NAMES[state]]
            assert f"{-1e3 * row['tip_z']:.2f} mm" in text
            assert f"{row['pitch_taken']:.0f}, {row['yaw_taken']:.0f}" in text
            cursor = browser.run("return parseFloat(document.querySelector('.cursor').style.left)")
            assert cursor == pytest.approx(100 * time / samples["time"].iloc[-1], abs=0.01)
            dot = browser.run("return ['cx', 'fill'].map(name => document.getElementById('dot').getAttribute(name))")
            assert dot == [str(data["lean"][k][0]), motion.colours[state]]
            peg = browser.run(
                "const o = viewer.scene_tree.find(['meshcat', 'peg']).object;"
                "const c = viewer.scene_tree.find(['meshcat', 'peg', 'body', '<object>']).object.material.color;"
                "return [o.position.z, '#' + c.getHexString().toUpperCase()]"
            )
            assert peg == [pytest.approx(np.interp(time, samples["time"], samples["tip_z"])), motion.colours[state]]
        corners = "edges.computeBoundingBox(); return [edges.attributes.position.count, edges.boundingBox.min.z]"
        count, bottom = browser.run(corners)
        assert count > 200  # ends of lines: arcs of 32 facets at the rim, the chamfer, the floor and outside
        assert bottom == pytest.approx(-35.0)  # mm
        assert browser.run("return document.querySelector('.dg.main').getClientRects().length") == 0  # over no panel
        heights = browser.run("return [...document.querySelectorAll('#arrows div')].map(e => e.offsetHeight)")
        assert max(heights) < 20  # a unit stays beside its number
        content = blankness(browser.screenshot())
        assert content.colours > 60
        assert content.drawn > 0.1
        browser.run("replay.seek(0); document.getElementById('play').click()")
        browser.wait("replay.time() >= replay.end - 1e-6 && document.getElementById('play').textContent === 'play'")
        assert browser.requests() == browser.errors() == []


@pytest.mark.parametrize("title", ['</script><b>sly & quoted"', "<!--<script>", "$data ${script} $"])
def test_page_is_self_contained_and_shows_any_title_as_text(title):
    page = replay_page(motion_of_demonstration(make_demonstration()), title=title)
    head = page[: page.index("<script>")]
    for outside in ("<script src", '<link rel="stylesheet', "@import", 'src="http', 'href="http'):
        assert outside not in head
    assert page.count("</script>") == 2
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
        guard=np.array([0, 2]),
        steps=np.array([[0, 0], [3, 5]]),
    )


def readings_of(page: str) -> dict[str, str]:
    """The text of the last sample of each reading, by its name."""
    names = re.findall(r'<tr><td>([^<]*)</td><td class="reading">', page)
    return {name: texts[-1] for name, texts in zip(names, data_of(page)["readings"], strict=True)}


def test_readings_worked_by_hand():
    page = replay_page(third_of_everything(), title="t")
    assert data_of(page)["time"] == [0, 0.333333]
    # The peg leans towards x: cos(1/3) = 0.944957 and sin(1/3) = 0.327195; so the lateral force is (0.4241, 0.3333) N.
    assert readings_of(page) == {
        "depth of the tip": "333.33 mm",
        "tilt in the hole": "19.10 °",
        "axial force": "0.3 N",
        "lateral force": "0.5 N",
        "moment": "577.4 N mm",
        "load": "57.7 of 50 N",  # sqrt((1 + 100^2) / 3), for a radius of 10 mm
        "back-off": "backing off",
        "microsteps": "3, 5",
    }


def test_the_dial_has_the_lean_over_three_rings_as_it_is_seen_from_the_camera():
    page = replay_page(third_of_everything(), title="t")
    assert "10° per ring" in page
    azimuth = np.arctan2(110, 124)  # of the camera, at x = 124 mm and y = 110 mm
    lean, lateral = np.array(data_of(page)["lean"]), np.array(data_of(page)["lateral"])
    right_and_down = np.array([-np.sin(azimuth), np.cos(azimuth)])  # where x points
    np.testing.assert_allclose(lean, [[0, 0], right_and_down * (1 / 3) / np.radians(30)], atol=1e-4)
    force = 0.4241 * right_and_down + 0.3333 * np.array([np.cos(azimuth), np.sin(azimuth)])
    np.testing.assert_allclose(lateral[1], force / np.hypot(0.4241, 0.3333), atol=1e-3)
    assert f'points="{lean[0][0]:.4f},{lean[0][1]:.4f} {lean[1][0]:.4f},{lean[1][1]:.4f}"' in page


def test_the_timeline_has_load_and_depth_over_the_phases_the_guard_and_the_steps():
    run = make_rig_run()
    page = replay_page(motion_of_run(run), title="t", speed=2.0)
    timeline = page[page.index('<div class="labels">') : page.index("<script>")]
    phases = re.findall(r'title="([^"]*)"', timeline.split('<div class="band">')[1].split("</div>")[0])
    assert phases == [STATE_NAMES[k] for k in (0, 1, 3, 2, 3)]
    guard = re.findall(r'title="([^"]*)"', timeline.split('<div class="guard">')[1].split("</div>")[0])
    assert set(guard) == {"inactive", "backing off", "turns reversed"}
    taken = run.samples[["pitch_taken", "yaw_taken"]].diff().iloc[1:].ne(0)
    steps = re.findall(r"M\d+ (\d)v", timeline)
    assert [steps.count("0"), steps.count("1")] == taken.sum().tolist()
    depth, load = re.findall(r'<path(?: class="force")? d="(M.*?)"', timeline)[:2]
    assert [int(y) for y in re.findall(r" (-?\d+)", depth)] == np.rint(-1e6 * run.samples["tip_z"]).astype(int).tolist()
    assert [int(y) for y in re.findall(r" (-?\d+)", load)] == np.rint(-1e3 * motion_of_run(run).load).astype(
        int
    ).tolist()
    assert "(limit 50 N)" in timeline
    assert "M0 -50000H" in timeline
    assert data_of(page)["speed"] == 2


def test_the_legend_has_the_states_that_occur_and_names_the_others():
    page = replay_page(motion_of_run(make_rig_run(state_names=[*STATE_NAMES, "never <seen>"])), title="t")
    assert re.findall(r"<span>(.*?)</span><span class=.share.>(\d+) %", page) == list(
        zip(STATE_NAMES, ["12", "8", "24", "55"], strict=True)
    )
    assert "never: never &lt;seen&gt;" in page
    assert "--force: #C1121F; --moment: #6A1B9A" in page


@pytest.mark.parametrize(("moment", "text"), [(0.17, "50 N mm"), (0.3, "0.1 N m")])
def test_legend_gives_what_an_arrow_of_10_mm_stands_for(moment, text):
    forces = {"force": np.array([[0, 0, 0], [0, 0, 30.0]]), "moment": np.array([[0, 0, 0], [0, moment, 0]])}
    page = replay_page(replace(third_of_everything(), **forces), title="t")
    assert "net force, 10 mm = 10 N<" in page
    assert f"moment, 10 mm = {text}<" in page


def test_the_contacts_share_the_scale_of_the_force_and_the_page_gives_their_sizes():
    motion = third_of_everything()
    forces = np.zeros((2, 3, 3))
    forces[1, 0], forces[1, 1] = [30.0, 0.0, 40.0], [-3.0, 0.0, 0.0]
    motion = replace(motion, contact_forces=forces, contact_points=np.zeros((2, 3, 3)))
    page = replay_page(motion, title="t")
    assert readings_of(page)["mouth, tip, face"] == "50.0, 3.0, 0.0 N"
    assert "each contact, 10 mm = 20 N" in page  # 50 N are 25 mm
    assert 'class="contact" >' in page
    assert 'class="contact" hidden>' in replay_page(third_of_everything(), title="t")


def test_page_of_a_demonstration_holds_no_guard_and_no_steps():
    page = replay_page(motion_of_demonstration(make_demonstration()), title="t")
    assert list(readings_of(page)) == ["depth of the tip", "tilt in the hole", "axial force", "lateral force", "moment"]
    assert "force, up to" in page
    for name in ("limit", "guard", "steps"):
        assert f'class="{name}"' not in page


@pytest.mark.parametrize("speed", [0.0, -1.0, np.inf, np.nan])
def test_speed_that_is_not_a_finite_number_above_0_is_an_error(speed):
    with pytest.raises(ValueError, match="speed"):
        replay_page(third_of_everything(), title="t", speed=speed)


def test_page_contains_the_viewer_and_the_commands_of_the_scene():
    page = replay_page(third_of_everything(), title="t")
    assert viewer_source() in page
    assert script_value(draw_scene(third_of_everything()).commands[:2])[1:-1] in page
