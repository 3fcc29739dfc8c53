"""Small sets of real recordings for the tests of output folders."""

from functools import partial

from experiments.outputs.output_set import DEMONSTRATIONS, SetIndex, open_set
from skill.data.demonstration import write_demonstration
from tests.trajectories import make_demonstration

NAMES = ("000_good_expert.parquet", "001_good_novice.parquet", "002_bad_blind.parquet")


def index_of(seed, names=NAMES):
    return SetIndex(DEMONSTRATIONS, {"seed": seed, "scenario": "a: 1\nb: 2\n"}, tuple(names), ("demonstrations.png",))


def write_item(files, name, seed):
    files.write(name, partial(write_demonstration, make_demonstration(seed=seed)))


def make_set(folder, seed, names=NAMES, *, overwrite=False, stop_after=None):
    """Makes a set of three recordings with a figure; ``stop_after`` leaves it after so many new items."""
    with open_set(folder, index_of(seed, names), overwrite=overwrite) as files:
        for k, name in enumerate(n for n in names if n not in files.finished):
            if k == stop_after:
                return files
            write_item(files, name, seed)
        files.complete()
        files.write("demonstrations.png", lambda path: path.write_bytes(b"figure %d" % seed))
    return files
