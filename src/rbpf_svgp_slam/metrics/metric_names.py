"""The numbers of report.json by what they are, for programs that print or compare them."""

#: What describes the run; of these only the first three can be told from its data.
COUNTERS = (
    "pings beams duration_s particles nodes seed pings_dropped wall_s real_time_factor "
    "iterations_total iterations_per_particle iterations_per_s loop_closure_prompts resamplings "
    "founders smoothing_s peak_rss_mb"
).split()
FROM_DATA = tuple(COUNTERS[:3])

#: Computed from the trajectories alone.
TRAJECTORY_METRICS = (
    "ate_rmse_m online_ate_rmse_m dr_ate_rmse_m ate_ratio "
    "ate_aligned_rmse_m online_ate_aligned_rmse_m dr_ate_aligned_rmse_m "
    "final_error_m dr_final_error_m rpe_rmse_m dr_rpe_rmse_m rpe_delta_s "
    "nees nees_skipped online_nees online_nees_skipped"
).split()
#: What the survey allows, whatever the method.
IDEAL_METRICS = "ideal_ate_rmse_m ideal_ate_aligned_rmse_m ideal_online_ate_rmse_m".split()
#: Of the loop closures.
CLOSURE_METRICS = (
    "closures_accepted closures_wrong closures_wrong_share closure_error_median_m closure_nees"
).split()
MAP_METRICS = (
    "map_rmse_m map_msll map_coverage grid_rmse_m grid_coverage map_rmse_on_grid_beams_m "
    "interval95_coverage held_out_beams map_rmse_at_ground_truth_m terrain_rmse_m noise_std_m"
).split()
SEABED_METRICS = (
    "seabed_rmse_m seabed_msll seabed_coverage seabed_rmse_on_grid_beams_m "
    "seabed_interval95_coverage seabed_terrain_rmse_m seabed_noise_std_m seabed_spacing_m"
).split()
#: What a hydrographer asks first.
SURVEY_METRICS = (
    "area_m2 track_length_m depth_min_m depth_median_m depth_max_m beams_per_m2 tvu95_m"
).split()
CONSISTENCY_METRICS = (
    "consistency_rmse_m dr_consistency_rmse_m ground_truth_consistency_rmse_m "
    "map_consistency_rmse_m "
    "overlap_consistency_rmse_m dr_overlap_consistency_rmse_m "
    "ground_truth_overlap_consistency_rmse_m"
).split()
METRICS = (
    *TRAJECTORY_METRICS,
    *IDEAL_METRICS,
    *CLOSURE_METRICS,
    *MAP_METRICS,
    *SEABED_METRICS,
    *SURVEY_METRICS,
    *CONSISTENCY_METRICS,
)

#: Errors of the filter and of its maps, of which the lowest is the best; not those of dead
#: reckoning, of the ground truth or of the grid, which are what they are compared with.
ERRORS = frozenset(
    "ate_rmse_m online_ate_rmse_m ate_ratio ate_aligned_rmse_m online_ate_aligned_rmse_m "
    "final_error_m rpe_rmse_m closures_wrong_share closure_error_median_m map_rmse_m map_msll "
    "map_rmse_on_grid_beams_m map_rmse_at_ground_truth_m terrain_rmse_m map_consistency_rmse_m "
    "seabed_rmse_m seabed_msll seabed_rmse_on_grid_beams_m seabed_terrain_rmse_m "
    "consistency_rmse_m overlap_consistency_rmse_m".split()
)
