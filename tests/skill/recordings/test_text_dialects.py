"""The same table in many dialects of text: it is read right, or refused in one line where a person could not know."""

import re
from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from skill.recordings.reading import read_recordings

CHANNELS = ("fx", "fy", "fz")
PREAMBLES = {
    "nothing": [],
    "comments": ['# made by a logger, 5" tool', "#", "# rate: 100 Hz; 1,2,3,4"],
    "Excel": ["sep={0}"],
    "ATI": ["Start Time:{0}5/29/2013 10:00:00 AM", "RDT Sample Rate:{0}7000", "Force Units:{0}N", ""],
    "LabVIEW": [
        *("LabVIEW Measurement{0}", "Writer_Version{0}2", "***End_of_Header***{0}", "{0}"),
        *("Channels{0}3", "Samples{0}9{0}9{0}9", "***End_of_Header***"),
    ],
    "prose": ["Recording of a force sensor", "", "by me, on Monday; with fx, fy and fz"],
}
READABLE = ("utf-8", "utf-8-sig", "utf-16", "utf-32")


@dataclass
class Dialect:
    separator: str
    decimal: str
    thousands: str
    form: str
    quotes: str
    encoding: str
    end: str
    missing: str
    preamble: str
    names: str
    units: str
    notes: str
    damaged: bool = False  # whether fields were written without the quotes that they need

    def __post_init__(self):
        if self.thousands == "other":  # than the decimal sign
            self.thousands = "." if self.decimal == "," else ","

    def number(self, value):
        """A number as this dialect writes it."""
        whole, point, rest = format(value, self.form).partition(".")
        if "e" not in whole + rest and whole.strip("-") != "0":
            whole = f"{int(whole):,}".replace(",", self.thousands)
        return whole + point.replace(".", self.decimal) + rest

    def row(self, fields):
        """A row of fields, with the quotes of this dialect."""
        needs = [any(c in f for c in (self.separator, "\n", '"')) or (not f and self.separator == " ") for f in fields]
        self.damaged |= any(needs) and self.quotes == "never"
        quoted = [self.quotes == "all" or (need and self.quotes == "needed") for need in needs]
        return self.separator.join(f'"{f}"' if q else f for f, q in zip(fields, quoted, strict=True))

    def text(self, table):
        """The table as text: time in ms and three forces in N; a row of NaN has no values."""
        names, units = ["time", *CHANNELS], ["ms", "N", "N", "N"]
        if self.units == "names":
            names = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
        notes = self.notes != "nothing" and self.names != "list"
        lines = [line.format(self.separator) for line in PREAMBLES[self.preamble]]
        if self.names != "list":
            mark = "# " if self.names == "comment" else ""
            lines.append(mark + self.row([*names, *["note"] * notes]))
            if self.units in ("row", "brackets"):
                shown = [f"[{unit}]" if self.units == "brackets" else unit for unit in units]
                lines.append(mark + self.row([*shown, *[""] * notes]))
        for row in table:
            fields = [self.missing if np.isnan(value) else self.number(value) for value in row]
            lines.append(self.row([*fields, *[self.notes] * notes]))
        return self.end.join([*lines, ""])


dialects = st.builds(
    Dialect,
    separator=st.sampled_from([",", ";", "\t", " "]),
    decimal=st.sampled_from([".", ","]),
    thousands=st.sampled_from(["", "", "other", "other", " ", "'", "\u202f"]),
    form=st.sampled_from([".0f", ".0f", ".1f", ".3f", ".3e", ".12g"]),
    quotes=st.sampled_from(["never", "needed", "all"]),
    encoding=st.sampled_from(["utf-8", "utf-8", "utf-8", *READABLE, "utf-16-le"]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    missing=st.sampled_from(["", "NaN", "-1.#IND", "1,#QNAN", "#N/A", "#NV", "-nan(ind)", "NULL", "n/a", "-", r"\N"]),
    preamble=st.sampled_from(list(PREAMBLES)),
    names=st.sampled_from(["line", "comment", "list"]),
    units=st.sampled_from(["names", "row", "brackets"]),
    notes=st.sampled_from(["nothing", "ok", "part #2", "two\nlines", "1.5", "23.11.2026", 'say ""ok""']),
)

tables = st.tuples(
    st.sampled_from([1.0, 20.0, 1000.0]),  # ms
    st.lists(st.none() | st.tuples(*[st.floats(-1e6, 1e6, allow_subnormal=False)] * 3), min_size=3, max_size=9).filter(
        lambda rows: sum(row is not None for row in rows) > 1
    ),
)


@given(dialects, tables)
def test_a_table_is_read_right_or_refused(tmp_path_factory, dialect, table):
    step, rows = table
    values = [[k * step, *(row or [np.nan] * 3)] for k, row in enumerate(rows)]
    path = tmp_path_factory.mktemp("a") / "a.txt"
    path.write_bytes(dialect.text(values).encode(dialect.encoding))
    written = np.array([[float(format(value, dialect.form)) for value in row] for row in values])  # as it is rounded
    written = written[~np.isnan(written[:, 1])]
    options = {"columns": ["time:ms,fx,fy,fz"]} if dialect.names == "list" else {}
    found, message = read(path, **options)
    if "--decimal" in message:  # all numbers could be read in two ways
        found, message = read(path, **options, decimal=dialect.decimal)
    if found is None:
        assert re.fullmatch(rf"({path}|a\.txt): .+", message)
        assert dialect.damaged or dialect.encoding not in READABLE, message
        return
    np.testing.assert_allclose(found.time, written[:, 0] * 1e-3, rtol=1e-12)
    np.testing.assert_array_equal(found.values, written[:, 1:])


def read(path, **options):
    """The recording and "", or None and the message of the refusal."""
    try:
        [found] = read_recordings(path, **options)
    except ValueError as error:
        return None, str(error)
    return found, ""
