"""The layouts of WrenchStamped, against bytes worked out by hand."""

import json
import re
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill.recordings.messages.wrench_message import DECODERS, decode_cdr, decode_json, decode_ros1
from tests.skill.recordings.messages.wrench_messages import WRENCH, as_json, cdr, ros1

BY_HAND = bytes.fromhex(
    "00010000"  # plain CDR, little-endian
    "0c000000"  # 12 s
    "0065cd1d"  # 500 000 000 ns
    "03000000"  # 3 bytes of text
    "667400"  # "ft" and its end
    "00"  # to a multiple of 8 after the first four bytes
    "000000000000f03f"  # 1.0
    "00000000000004c0"  # -2.5
    "0000000000000840"  # 3.0
    "000000000000d03f"  # 0.25
    "7b14ae47e17a743f"  # 0.005
    "00000000000018c0"  # -6.0
)


def test_the_layout_of_ros_2_is_that_worked_out_by_hand():
    assert cdr(frame="ft") == BY_HAND
    assert decode_cdr(BY_HAND) == ("ft", 12.5, WRENCH)


@pytest.mark.parametrize("decode_write", [(decode_cdr, cdr), (decode_ros1, ros1), (decode_json, as_json)])
@given(
    frame=st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=20),
    sec=st.integers(0, 2**31 - 1),
    nanosec=st.integers(0, 10**9 - 1),
    wrench=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=6, max_size=6),
)
def test_every_message_is_decoded(decode_write, frame, sec, nanosec, wrench):
    decode, write = decode_write
    assert decode(write(sec, nanosec, frame, wrench)) == (frame, sec + nanosec * 1e-9, tuple(wrench))


def test_other_byte_orders_and_names_of_fields():
    assert decode_cdr(cdr(order=">", frame="tool0")) == ("tool0", 12.5, WRENCH)
    assert decode_cdr(cdr() + bytes(4)) == ("ft_link", 12.5, WRENCH)
    assert decode_json(as_json(fraction="nsec")) == decode_json(as_json(fraction="nsecs")) == ("ft_link", 12.5, WRENCH)
    assert decode_json(b'{"wrench": ' + json.dumps(json.loads(as_json())["wrench"]).encode() + b"}") == ("", 0, WRENCH)


def test_null_in_json_is_no_number():
    assert np.isnan(decode_json(as_json(wrench=[None] * 6)).wrench).all()


@pytest.mark.parametrize(("encoding", "write"), [("cdr", cdr), ("ros1", ros1), ("json", as_json)])
def test_a_truncated_message_is_refused(encoding, write):
    message = write()
    for length in range(len(message)):
        with pytest.raises(ValueError, match=r"too few|encapsulation|Expecting|Unterminated|delimiter|Invalid"):
            DECODERS[encoding](message[:length])


REFUSED = {
    "XCDR 2": (decode_cdr, b"\0\7" + cdr()[2:], "encapsulation 0007, expected plain CDR (0000 or 0001)"),
    "long": (decode_cdr, cdr() + bytes(8), "8 bytes after the torque, expected a WrenchStamped"),
    "huge text": (decode_cdr, cdr()[:12] + struct.pack("<I", 2**32 - 1) + cdr()[16:], "too few for a WrenchStamped"),
    "long ROS 1": (decode_ros1, ros1() + bytes(8), "8 bytes after the torque"),
    "no torque": (decode_json, b'{"wrench": {"force": {"x": 1, "y": 1, "z": 1}}}', "no numbers in header.stamp"),
    "text": (decode_json, as_json().replace(b"-2.5", b'"a"'), "'a' is no number"),
    "truth": (decode_json, as_json().replace(b"-2.5", b"true"), "True is no number"),
    "list": (decode_json, b"[]", "found list, expected an object"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_another_message_is_refused(name):
    decode, message, text = REFUSED[name]
    with pytest.raises(ValueError, match=re.escape(text)):
        decode(message)
