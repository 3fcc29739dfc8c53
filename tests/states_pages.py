"""Reads the series and bands out of a page of contact states, for tests."""

import re

import numpy as np
from numpy.typing import NDArray


def series_of(page: str) -> list[tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]]:
    """The time (s) and the series by channel of each recording, in the units of the page."""
    found = []
    for trial in page.split('<section class="panel trial">')[1:]:
        series = {}
        for step, content in re.findall(r'<svg .*?data-step="(.*?)".*?>(.*?)</svg>', trial):
            for name, path in re.findall(r'data-name="(.*?)".*? d="(.*?)"', content):
                x, y = np.array([float(number) for number in re.findall(r"-?\d+", path)]).reshape(-1, 2).T
                series[name] = -y * float(step)
        found.append((x / 1e4, series))
    return found


def bands_of(page: str, name: str) -> list[list[tuple[str, str]]]:
    """The first sample and the text of each run in the bands of one name."""
    bands = re.findall(rf'<div class="band" data-name="{name}">(.*?)</div>', page)
    return [re.findall(r'data-first="(\d+)".*?>(.*?)</i>', band) for band in bands]
