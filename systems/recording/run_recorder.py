"""Records the measurements, commands and motions of the rig, one row per controller period."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Multiplexer, VectorLogSink

from skill.data.rig_run import LOGGED_COLUMNS


@dataclass(frozen=True)
class RunRecorder:
    """The log of a rig.

    Attributes:
        log: the log, one row per period.
        names: names of the elements of a row.
        home: position of the carriage at which the tip is level with the mouth, m.
    """

    log: VectorLogSink
    names: list[str]
    home: float

    def samples(self, context: Context) -> pd.DataFrame:
        """Returns the rows of a run, ``LOGGED_COLUMNS``; ``context`` is the diagram's.

        The columns of an axis that the rig does not have are zero.
        """
        log = self.log.FindLog(context)
        table = pd.DataFrame(np.asarray(log.data()).T, columns=self.names)
        table["time"] = log.sample_times()
        table["tip_z"] = table["carriage"] - self.home
        return table.reindex(columns=list(LOGGED_COLUMNS), fill_value=0.0)


def AddRunRecorder(
    *, builder: DiagramBuilder, ports: Mapping[tuple[str, ...], OutputPort], period: float, home: float
) -> RunRecorder:
    """Adds a multiplexer that joins ports to one row, and a log of that row.

    Args:
        builder: builder of the diagram.
        ports: output ports by the names of their elements; one is named "carriage", the carriage's position (m).
        period: time between rows, s.
        home: position of the carriage at which the tip is level with the mouth, m.
    """
    row = builder.AddNamedSystem("run_row", Multiplexer([port.size() for port in ports.values()]))
    for k, port in enumerate(ports.values()):
        builder.Connect(port, row.get_input_port(k))
    log = builder.AddNamedSystem("run_log", VectorLogSink(row.get_output_port().size(), period))
    builder.Connect(row.get_output_port(), log.get_input_port())
    return RunRecorder(log, [name for names in ports for name in names], home)
