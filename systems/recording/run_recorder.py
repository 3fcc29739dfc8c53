"""Logs what the rig measured, commanded and did, once a controller period."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Multiplexer, VectorLogSink

from skill.data.rig_run import RUN_COLUMNS


@dataclass(frozen=True)
class RunRecorder:
    """A multiplexer and a log, and the names of what runs through them."""

    log: VectorLogSink
    names: list[str]
    home: float

    @staticmethod
    def AddToBuilder(
        *, builder: DiagramBuilder, ports: Mapping[tuple[str, ...], OutputPort], period: float, home: float
    ) -> RunRecorder:
        """Joins ``ports``, each with the names of its elements, into one logged row.

        Args:
            builder: of the diagram.
            ports: from names to port; among them "carriage", the carriage's position (m).
            period: between rows, s.
            home: position of the carriage at which the tip is level with the mouth, m.
        """
        row = builder.AddNamedSystem("run_row", Multiplexer([port.size() for port in ports.values()]))
        for k, port in enumerate(ports.values()):
            builder.Connect(port, row.get_input_port(k))
        log = builder.AddNamedSystem("run_log", VectorLogSink(row.get_output_port().size(), period))
        builder.Connect(row.get_output_port(), log.get_input_port())
        return RunRecorder(log, [name for names in ports for name in names], home)

    def samples(self, context: Context) -> pd.DataFrame:
        """The rows of a run, columns ``RUN_COLUMNS``; ``context`` is the diagram's."""
        kept = self.log.FindLog(context)
        table = pd.DataFrame(np.asarray(kept.data()).T, columns=self.names)
        table["time"] = kept.sample_times()
        table["tip_z"] = table["carriage"] - self.home
        return table[list(RUN_COLUMNS)]
