import json
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from scripts.replay import app
from skill.data.demonstration import Demonstration, write_demonstration
from skill.data.rig_run import RigRun, write_rig_run
from skill.data.tables import write_table
from systems.reports.motion import motion_of_demonstration, motion_of_run, read_motion
from systems.reports.replay_page import replay_page
from systems.reports.scene import arrow_scale
from tests.browser import blankness, open_page
from tests.trajectories import STATE_NAMES, STEP, make_demonstration, make_rig_run

ROOT = Path(__file__).parents[2]


def run_replay(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, result.output


@pytest.fixture
def demonstration_file(tmp_path: Path) -> Path:
    path = tmp_path / "demonstration.parquet"
    write_demonstration(make_demonstration(), path)
    return path


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    path = tmp_path / "run.parquet"
    write_rig_run(make_rig_run(), path)
    return path


# -------------------------------------------------------------------------- motion


def test_peg_of_a_demonstration_leans_where_its_rotation_puts_the_axis():
    tilt, direction = np.radians(2.5), 0.9
    motion = motion_of_demonstration(make_demonstration(tilt=tilt, direction=direction))
    np.testing.assert_allclose(motion.lean[0], tilt * np.array([np.cos(direction), np.sin(direction)]), atol=1e-9)
    np.testing.assert_allclose(motion.p_WH, 0.0)


def test_hole_of_a_rig_turns_by_pitch_then_yaw_about_the_pivot():
    height = -0.016
    run = make_rig_run(rig={"pivot_height": height})
    motion = motion_of_run(run)
    k = 20
    pitch, yaw = run.samples.loc[k, ["pitch", "yaw"]]
    R = Rotation.from_rotvec([pitch, 0, 0]) * Rotation.from_rotvec([0, yaw, 0])
    np.testing.assert_allclose(motion.R_WH[k].as_matrix(), R.as_matrix(), atol=1e-12)
    # The pivot itself stays where it is.
    np.testing.assert_allclose(motion.p_WH[k] + R.apply([0, 0, height]), [0, 0, height], atol=1e-12)
    # For small angles the peg leans, seen from the hole, by -yaw along x and by +pitch along y.
    np.testing.assert_allclose(motion.lean[k], [-yaw, pitch], atol=1e-3 * STEP + 1e-4)
    assert np.linalg.norm(motion.lean[k]) == pytest.approx(np.arccos(np.cos(pitch) * np.cos(yaw)), abs=1e-9)


def test_without_a_skill_a_demonstration_is_coloured_by_its_force():
    motion = motion_of_demonstration(make_demonstration())
    force = np.linalg.norm(motion.force, axis=1)
    assert motion.colouring == "contact force"
    assert motion.phases[0] == "below 0.5 N"
    assert np.array_equal(motion.phase == 0, force < 0.5)


class TwoStates:
    def state_names(self):
        return ["near the mouth", "deep"]

    def state_probabilities(self, measured: np.ndarray) -> np.ndarray:
        deep = (measured[:, 6] < -0.01).astype(float)
        return np.column_stack([1 - deep, deep])


def test_a_skill_tells_the_states_of_a_demonstration():
    demonstration = make_demonstration()
    motion = motion_of_demonstration(demonstration, TwoStates())
    assert motion.colouring == "contact state"
    assert np.array_equal(motion.phase == 1, demonstration.samples["z"] < -0.01)
    assert motion.phases == ["near the mouth", "deep"]


def test_largest_arrow_fits_and_its_scale_is_round():
    motion = motion_of_run(make_rig_run())
    scale = arrow_scale(motion)
    assert np.linalg.norm(motion.force, axis=1).max() / scale.force <= 0.035
    assert f"{0.01 * scale.force:g}".strip("0.") in ("1", "2", "5")


# ---------------------------------------------------------------------------- page


def test_page_of_a_rig_run_shows_the_scene_and_what_holds_at_a_time(run_file, tmp_path):
    page = tmp_path / "run.html"
    assert run_replay(run_file, "--out", page, "--no-open")[0] == 0
    samples = make_rig_run().samples
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
            pushed = np.hypot(np.linalg.norm(row[["fx", "fy", "fz"]]), np.linalg.norm(row[["mx", "my", "mz"]]) / 0.01)
            assert f"{pushed:.1f} of 50 N" in text
            bar = browser.run("return parseFloat(document.querySelector('#load-bar div').style.width)")
            assert bar == pytest.approx(2 * pushed, abs=0.01)
            assert f"{row['pitch_taken']:.0f}, {row['yaw_taken']:.0f}" in text
            peg = browser.run(
                "const o = viewer.scene_tree.find(['meshcat', 'peg']).object;"
                "const c = viewer.scene_tree.find(['meshcat', 'peg', 'body', '<object>']).object.material.color;"
                "return [o.position.x, o.position.y, o.position.z, '#' + c.getHexString().toUpperCase()]"
            )
            between = np.interp(time, samples["time"], samples["tip_z"])
            assert peg[:3] == pytest.approx([0, 0, between], abs=1e-8)
            motion = motion_of_run(make_rig_run())
            assert peg[3] == motion.colours[int(row["state"])]
        text = browser.run("return document.body.innerText")
        for name in (*STATE_NAMES, "moment, 10 mm", "force guard", "rig run: inserted"):
            assert name in text
        picture = browser.screenshot()
        seen = blankness(picture)
        assert seen.colours > 60
        assert seen.drawn > 0.1
        view = blankness(picture[100:-140, 320:-320])  # between the panels: the scene alone
        assert view.colours > 20
        assert view.drawn > 0.15
        assert browser.requests() == []
        assert browser.errors() == []


def test_a_state_that_is_never_visited_takes_no_row_and_a_demonstration_has_no_guard(demonstration_file, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(replay_page(motion_of_run(make_rig_run(state_names=[*STATE_NAMES, "never seen"])), title="run"))
    with open_page(page) as browser:
        browser.wait("window.replay && replay.ready && document.querySelector('.now')")
        assert browser.run("return document.querySelectorAll('#phases > div').length") == len(STATE_NAMES)
        assert "never: never seen" in browser.run("return document.getElementById('card').innerText")
    page.write_text(replay_page(read_motion(demonstration_file), title="shown"))
    with open_page(page) as browser:
        browser.wait("window.replay && replay.ready && document.querySelector('.now')")
        assert browser.run("return document.querySelectorAll('.rig').length") == 0
        assert browser.errors() == []


def test_page_of_a_demonstration_plays_to_its_end(demonstration_file):
    assert run_replay(demonstration_file, "--no-open", "--speed", 8)[0] == 0
    with open_page(demonstration_file.with_suffix(".html")) as browser:
        browser.wait("window.replay && replay.time() >= replay.end - 1e-6")
        first = browser.screenshot()
        turn = browser.run("return viewer.scene_tree.find(['meshcat', 'peg']).object.quaternion.toArray()")
        last = motion_of_demonstration(make_demonstration()).R_WP[-1].as_quat()
        np.testing.assert_allclose(turn, last, atol=1e-6)
        browser.wait("document.getElementById('play').textContent === 'play'")
        browser.run("document.getElementById('play').click(); replay.pause(); replay.seek(0)")
        browser.wait("document.getElementById('reading-time').textContent === '0.00 s'")
        assert browser.run("return document.getElementById('reading-tilt').textContent") == "2.50 °"
        changed = np.abs(browser.screenshot().astype(int) - first).max(axis=2) > 24
        assert changed.mean() > 0.01
        assert browser.requests() == []
        assert browser.errors() == []


def test_arrow_points_along_the_force_and_is_as_long(tmp_path):
    motion = motion_of_demonstration(make_demonstration())
    page = tmp_path / "page.html"
    page.write_text(replay_page(motion, title="arrow"))
    k = int(np.linalg.norm(motion.force, axis=1).argmax())
    with open_page(page, fragment=f"#t={motion.time[k]}") as browser:
        browser.wait("window.replay && replay.ready")
        browser.wait(f"Math.abs(replay.time() - {motion.time[k]}) < 1e-6")
        end = browser.run(
            "viewer.scene.updateMatrixWorld(true);"
            "const head = viewer.scene_tree.find(['meshcat', 'force', 'head', 'cone0']).object;"
            "return head.parent.localToWorld(head.position.clone().setZ(0.004)).toArray()"
        )
    # The viewer's own world has y upwards.
    end_W = np.array([end[0], -end[2], end[1]])
    expected = motion.p_WP[k] + motion.R_WP[k].apply(motion.force[k]) / arrow_scale(motion).force
    np.testing.assert_allclose(end_W, expected, atol=1e-6)


def test_page_carries_all_it_needs(demonstration_file):
    page = replay_page(read_motion(demonstration_file), title='</script><b>sly & quoted"')
    head = page[: page.index("<script>")]
    for outside in ("<script src", '<link rel="stylesheet', "@import", 'src="http', 'href="http'):
        assert outside not in head
    assert page.count("</script>") == 2
    data = page[page.index("const data = ") + len("const data = ") :].split(";\n", 1)[0]
    assert json.loads(data)["title"] == '</script><b>sly & quoted"'


# -------------------------------------------------------------------- command line


def test_runs_where_drake_cannot_be_imported(run_file, demonstration_file, tmp_path):
    script = textwrap.dedent(
        """
        import sys
        sys.modules["pydrake"] = None
        from scripts.replay import app
        app(sys.argv[1:])
        """
    )
    for source in (run_file, demonstration_file):
        done = subprocess.run(
            [sys.executable, "-c", script, str(source), "--no-open"], cwd=ROOT, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        assert source.with_suffix(".html").stat().st_size > 500_000


def test_help_teaches():
    code, text = run_replay("--help")
    assert code == 0
    for word in ("--skill", "--speed", "--out", "--open", "python -m scripts.replay"):
        assert word in text


def _other_kind(path: Path) -> None:
    samples = make_rig_run().samples[["time", "fx"]]
    write_table(samples, ("time", "fx"), path, kind="notes", version=1, header={})


def _truncated(path: Path) -> None:
    write_rig_run(make_rig_run(), path)
    path.write_bytes(path.read_bytes()[:-500])


def _without_geometry(path: Path) -> None:
    good = make_demonstration()
    write_demonstration(Demonstration(good.samples, True, "inserted", {"seed": 1}), path)


def _half_a_geometry(path: Path) -> None:
    good = make_rig_run()
    write_rig_run(RigRun(good.samples, good.result, {"geometry": {"peg_radius": 0.01}}), path)


def _impossible_geometry(path: Path) -> None:
    good = make_rig_run()
    geometry = {**good.metadata["geometry"], "block_radius": 0.005}
    write_rig_run(RigRun(good.samples, good.result, {"geometry": geometry}), path)


def _too_few_names(path: Path) -> None:
    write_rig_run(make_rig_run(state_names=["free"]), path)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.write_text("time,x\n0,1\n"), "not a complete Parquet file"),
        (_truncated, "not a complete Parquet file"),
        (_other_kind, "neither a demonstration nor a rig run"),
        (_without_geometry, "no geometry"),
        (_half_a_geometry, "geometry lacks"),
        (_impossible_geometry, "block radius 0.005"),
        (_too_few_names, "1 state names"),
    ],
)
def test_a_bad_file_ends_with_one_message_that_names_it(tmp_path, write, message):
    path = tmp_path / "bad.parquet"
    write(path)
    before = sorted(tmp_path.iterdir())
    code, output = run_replay(path, "--no-open")
    assert code == 1
    assert output.count("error:") == 1
    assert str(path) in output.replace("\n", "")
    assert message in output
    assert "Traceback" not in output
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("speed", ["0", "-1", "nan"])
def test_an_impossible_speed_is_refused(run_file, speed):
    code, output = run_replay(run_file, "--speed", speed, "--no-open")
    assert code == 1
    assert "speed" in output
    assert not run_file.with_suffix(".html").exists()


def test_a_missing_skill_is_named(demonstration_file, tmp_path):
    code, output = run_replay(demonstration_file, "--skill", tmp_path / "none.npz", "--no-open")
    assert code == 1
    assert "none.npz" in output
    assert not demonstration_file.with_suffix(".html").exists()


def test_the_source_is_not_overwritten(run_file):
    before = run_file.read_bytes()
    assert run_replay(run_file, "--out", run_file, "--no-open")[0] == 1
    assert run_file.read_bytes() == before


# ------------------------------------------------------------------------- browser


def test_a_missing_browser_fails_and_names_the_package(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(AssertionError, match="apt-get install chromium chromium-driver"), open_page(tmp_path):
        pass


def test_a_shaded_background_alone_is_blank():
    shade = np.linspace(120, 250, 200, dtype=np.uint8)
    picture = np.broadcast_to(shade[:, None, None], (200, 300, 3)).copy()
    assert blankness(picture).drawn == 0
    picture[50:100, 60:120] = [200, 30, 30]
    assert blankness(picture).drawn == pytest.approx(50 * 60 / (200 * 300))


def test_errors_of_the_console_are_seen(tmp_path):
    page = tmp_path / "page.html"
    page.write_text("<script>console.error('out of order'); fetch('http://127.0.0.1:9/x').catch(() => 0)</script>")
    with open_page(page) as browser:
        browser.wait("document.readyState === 'complete'")
        assert any("out of order" in message for message in browser.errors())
        assert "http://127.0.0.1:9/x" in browser.requests()
