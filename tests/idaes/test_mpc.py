"""Predictive control of the IDAES level: the first steps of the loop have certified answers from the shifted branch."""

import pytest

pytest.importorskip('idaes', reason="needs the extra: pip install -e '.[idaes]'")

import idaes_mpc  # noqa: E402


def test_the_loop_has_answers_and_draws(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    real, steps = idaes_mpc.loop(4, time_limit=60)
    assert (steps['origin'] != 'plan').all() and steps['certified'].iloc[1:].any()
    assert real.trajectory()[idaes_mpc.FLOW].between(-1e-9, idaes_mpc.OPEN + 1e-9).all()
    idaes_mpc.draw(real, steps)
    assert (tmp_path / idaes_mpc.PICTURE).stat().st_size > 10_000
