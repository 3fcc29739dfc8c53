"""Sweeps of quick trials."""

import pyarrow as pa
import pyarrow.dataset as ds
import pytest
import yaml

from experiments.sweep.trial_files import PARTITIONS
from models.scenario import dump_scenario
from scripts import sweep
from tests.quick_scenario import make_quick_scenario
from tests.scripts.commands import ROOT

PARTITIONING = ds.partitioning(pa.schema([(name, pa.string()) for name in PARTITIONS]), flavor="hive")
"""How a data set is read so that the names of the folders stay texts: 01 is not 1."""


@pytest.fixture
def scenario_file(tmp_path):
    path, scenario = tmp_path / "quick.yaml", make_quick_scenario()
    scenario.trial.time_limit = 1.0
    path.write_text(dump_scenario(scenario))
    return path


@pytest.fixture
def specification(tmp_path, scenario_file):
    """Writes a specification with quick trials; the arguments are its keys."""

    def write(name="sweep", **keys):
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml.safe_dump({"scenario": str(scenario_file), **keys}))
        return path

    return write


@pytest.fixture
def perform(tmp_path, monkeypatch):
    """Performs a sweep into ``tmp_path / "results"`` and returns its rows as a frame."""
    monkeypatch.chdir(ROOT)

    def run(path, *, dask=None, jobs=2, results="results"):
        sweep.main(path, tmp_path / results, dask=dask, jobs=jobs)
        return rows_in(tmp_path / results)

    return run


def rows_in(results):
    """All rows of a data set, in the order of their keys."""
    data = ds.dataset(results / "trials", format="parquet", partitioning=PARTITIONING)
    return data.to_table().to_pandas().sort_values("key", ignore_index=True)
