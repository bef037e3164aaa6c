#pragma once
#include <cstddef>
#include <cstdint>

namespace ringlock::closure {

/// Numbers for the report on the closed model: its scenario and its simulations (report).
struct ReportOptions {
    /// Injected noise at the turns below this does not randomise the phase; the scenario then has a dither without
    /// noise [rad].
    double least_injected_rad = 0.01;
    /// A wander of the dither's amplitude from one turn to the next that is smaller than this share of the readout's
    /// noise is not visible, and the scenario has none [1].
    double least_wander = 0.05;
    /// Bounds of the keys readout.detector_noise_relative [1] and reader.reference_noise_arcsec of a scenario.
    double most_detector_noise = 0.1;
    double most_reference_noise_arcsec = 1e6;
    /// Effort: most turns that are simulated in all.
    std::int64_t most_turns = 4'000'000;
    /// Fewest simulations, whatever their duration, unless fewer are requested, and most simulations: one further
    /// simulation lies between the lowest and the highest of 39 with a probability of 95 %.
    int fewest_simulations = 9;
    int most_simulations = 39;
    int base_simulations = 5;  ///< of the base model alone; figures show their mean

    /// Bands of the spectrum that are compared, of equal ratio, and fewest coefficients in each: a mean of four
    /// periodogram ordinates has a relative standard deviation of a half.
    int spectrum_bands = 30;
    std::size_t fewest_in_band = 4;

    /// Phases at which kicks are compared; harmonics of the phase that are fitted to the angle for them; and turns per
    /// stretch of that fit, each with a straight line of its own, so that slow rates do not matter.
    std::size_t phase_points = 12;
    int kick_harmonics = 3;
    std::size_t turns_in_stretch = 256;
    /// Most points of the figure of the rate over time.
    std::size_t points_over_time = 1000;
    /// Most lines with a figure of their own; the reach of the figure to either side, in resolutions of the record; and
    /// points per resolution.
    std::size_t most_lines_drawn = 4;
    int resolutions_around_line = 20;
    int points_a_resolution = 8;

    /// Phases with fewer turns than this are not compared: their kicks are not determined.
    double fewest_at_phase = 4.0;
};

}  // namespace ringlock::closure
