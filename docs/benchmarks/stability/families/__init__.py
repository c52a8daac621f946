"""All families of cases: functions that yield ``Case`` objects with known answers."""

from benchmarks.stability.families import events, mpccs, one_switch, scaling, sliding, smooth_dynamics, switching_times

FAMILIES = (
    *(one_switch.crossings, one_switch.slides, one_switch.not_unique, one_switch.simultaneous, one_switch.sensitivity),
    *(one_switch.false_minima, one_switch.free_start),
    *(switching_times.stage_boundary, switching_times.at_the_start, switching_times.close_pair, switching_times.many_switches),
    switching_times.grazing,
    *(sliding.start_in_slide, sliding.chattering, sliding.chattering_optimum, sliding.curved),
    *(scaling.scaling, scaling.horizons),
    *(smooth_dynamics.oscillators, smooth_dynamics.stiff_modes, smooth_dynamics.van_der_pols, smooth_dynamics.gene_network),
    *(mpccs.statics, events.thermostat_cases, events.ball_cases, events.zeno_cases),
)


def all_cases():
    """Yield the cases of all families."""
    for family in FAMILIES:
        yield from family()
