from skill.recordings.channel_groups import ChannelGroup, channel_groups


def test_channels_are_grouped_by_what_they_measure():
    groups = channel_groups(("fx", "fy", "fz", "mx", "px", "qw", "qx", "rx", "depth", "grip"))
    assert groups == [
        ChannelGroup("force", "N", 1.0, ("fx", "fy", "fz")),
        ChannelGroup("moment", "N m", 1.0, ("mx",)),
        ChannelGroup("position", "mm", 1e3, ("px", "depth")),
        ChannelGroup("rotation", "rad", 1.0, ("rx",)),
        ChannelGroup("orientation", "", 1.0, ("qw", "qx")),
        ChannelGroup("other", "", 1.0, ("grip",)),
    ]


def test_groups_without_channels_are_left_out():
    assert [group.name for group in channel_groups(("mz", "fz"))] == ["force", "moment"]
