import gc

import pytest


@pytest.fixture(scope="module", autouse=True)
def no_meshcat_is_left_to_the_threads_of_a_page():
    """Frees the Meshcats of earlier tests here: Drake aborts if another thread's garbage collection frees one."""
    gc.collect()
    yield
    gc.collect()
