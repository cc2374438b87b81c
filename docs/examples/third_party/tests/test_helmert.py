from pathlib import Path

from aatri.testing.check import check_stage


def test_helmert_keeps_its_contract():
    check_stage("interior_orientation/helmert", local=Path(__file__).parents[1] / "stages")
