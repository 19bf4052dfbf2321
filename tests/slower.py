"""What runs with `pytest -m slow` only: full counts of cases, and what other tests do, too, in other scenes."""

# Folders in which one theorem is tried on many cases: the first, the middle and the last of them run by default
MANY_CASES = (
    "basis",
    "linalg",
    "linear",
    "mbs/floating",
    "mbs/mechanism",
    "mechanism_bounds/test_passive_steps.py",
    "models",
)
FEW = 3
EVERY_CASE = {  # each of their cases is another thing
    "mbs/floating/test_floating_input.py::test_what_holds_a_body",
    "mbs/floating/test_floating_scene.py::test_scenes_are_in_balance_from_the_start",
    "mbs/floating/test_floating_scene.py::test_scopes",
}

SLOWER = {  # file -> tests that take seconds, and what is tried without them
    "docs_and_examples/test_benchmarks.py": {  # smoke tests of the other benchmarks
        "test_forked_runs_begin_where_they_were_forked",
        "test_forked_runs_copy_no_memory",
        "test_large_bodies_measures_every_task",
    },
    "docs_and_examples/test_examples.py": {  # the linkage, the clamped bar, the slider crank, pages of docs
        "test_double_pendulum_shows_what_frozen_inputs_hide",
        "test_flexible_pendulum_has_the_same_bounds_from_its_file",
        "test_modes_that_the_rod_needs_are_found",
        "test_rotor_run_up_has_a_bound_that_says_something",
        "test_sprung_body_is_bounded_from_its_static_equilibrium_on",
    },
    "docs_and_examples/test_exudyn_examples.py": {"test_a_run_that_we_change_is_found_out"},
    "docs_and_examples/test_scripts.py": {  # test_verify.py; docs/verify.md
        "test_gallery_shows_what_is_printed",
        "test_a_robots_step_is_wrong_and_not_its_modes",
        "test_interfaces_are_what_a_run_with_free_ones_shows",
    },
    "docs_and_examples/test_told_and_true.py": {
        "test_stored_truths_are_what_is_made_anew",
    },
    "docs_and_examples/test_wheel.py": {  # .ci/run installs a wheel before any test runs
        "test_examples_run_from_any_folder",
        "test_import_brings_nothing",
        "test_installed_package_shows_a_saved_report",
        "test_sweep_works_in_spawned_processes",
        "test_wheel_asks_for_four_packages",
        "test_wheel_has_the_package_and_nothing_else",
        "test_wheel_without_a_compiler_lacks_the_compiled_part_only",
    },
    "linear/estimators/test_mutation.py": {"test_nothing_is_violated_without_mutation"},  # the theorem's own tests
    "linear/estimators/test_theorem_paper.py": {"test_half_of_the_bounds_are_sharp"},  # of all seeds
    "linear/estimators/test_turning_frame.py": {"test_half_of_the_bounds_are_sharp"},
    "mbs/floating/test_floating_bounds.py": {  # truths against truths
        "test_both_truths_of_the_clamped_bar_agree",
        "test_half_the_step_does_not_change_the_full_motion",
        "test_more_modes_do_not_make_the_bound_larger",
        "test_the_full_motion_is_that_of_a_complete_basis",
    },
    "mbs/mechanism/test_half_widths.py": {
        "test_half_widths_do_not_grow_with_the_square_of_the_phase",
        "test_rotor_that_falls_behind_is_turned_not_stretched",
    },
    "mbs/mechanism/test_output_estimates.py": {"test_first_steps_of_the_truth_are_those_stored"},
    "mbs/monitoring/test_mechanism_monitor.py": {"test_a_report_is_drawn_and_written"},
    "mbs/studies/test_choose_modes.py": {  # the pendulum, the slider crank, docs/how_many_modes.md
        "test_forecast_is_what_runs_with_more_and_fewer_modes_find",
        "test_forecast_of_velocities",
        "test_free_interfaces_are_chosen_where_rigid_ones_stiffen",
        "test_picked_modes_are_fewer_than_the_first_ones",
        "test_rigid_interfaces_are_kept_where_they_do",
        "test_rigid_interfaces_that_alone_are_too_stiff_are_said_so",
        "test_step_is_not_the_limit_where_it_is_short",
        "test_two_bodies_and_a_static_solve_before",
    },
    "mbs/studies/test_study.py": {"test_an_absolute_tolerance_makes_kilometres_unusable"},
    "model/test_fe_input.py": {"test_ngsolve_example"},
    "model/test_stress.py": {"test_curved_mesh_of_ngsolve"},
    "models/test_estimate_truths.py": {"test_first_steps_are_those_stored"},  # stored truths, made again
    "models/test_floating_models.py": {"test_more_modes_come_closer_to_the_complete_bar"},
    "models/test_mechanism_models.py": {
        "test_effect_of_modes_does_not_depend_on_the_step",
        "test_more_modes_come_closer_to_all",
        "test_rigid_faces_are_an_error_that_no_number_of_modes_removes",
    },
    "models/test_mechanism_truths.py": {"test_first_steps_are_those_stored"},
    "models/test_wishbone.py": {
        "test_bounds_are_coupled_and_nothing_is_missing",
        "test_example_draws_and_tells_what_is_enough",
        "test_loads_are_the_same_where_the_static_solve_ends_and_the_drive_begins",
        "test_stored_arm_is_what_make_wishbone_makes",
    },
    "report/test_pictures.py": {"test_example_writes_one_picture_of_each_kind"},
    "scripts/test_verify.py": {"test_functions_and_any_executor"},
}


def are_slow(names: dict[str, list[str]]) -> set[str]:
    """Return the ids of tests that are slow; names : ids of all cases, by "file::test"."""
    found: set[str] = set()
    for test, cases in names.items():
        file, _, name = test.partition("::")
        if name.rpartition("::")[2] in SLOWER.get(file, ()):
            found.update(cases)
        elif test not in EVERY_CASE and file.startswith(MANY_CASES) and len(cases) > FEW:
            found.update({*cases} - {cases[0], cases[len(cases) // 2], cases[-1]})
    return found
