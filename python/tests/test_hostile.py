"""What a program may hand over by mistake, and signals while the engine works."""

import os
import signal
import threading

import numpy as np
import pytest

import thirdbounce
from thirdbounce._arrays import as_bools


def test_bytes_seen_as_bools_are_bools():
    odd = np.array([0, 1, 2, 255], dtype=np.uint8).view(np.bool_)
    plain = as_bools(odd)
    assert plain.dtype == np.bool_
    assert plain.view(np.uint8).tolist() == [0, 1, 1, 1]
    assert as_bools(np.array([[0.0, 2.5]])).view(np.uint8).tolist() == [0, 1]


def test_an_interrupt_is_heard_while_a_scene_is_rendered():
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            thirdbounce.simulate("figure", scan=16, wall=1.0)
