#pragma once
#include <cstddef>
#include <cstdint>

namespace ringlock::closure {

/// Numbers that decide what is reported of the closed model: its scenario and its simulations (report).
struct ReportOptions {
    /// Injected noise at the turns below this randomises nothing, and the scenario has a dither without noise [rad].
    double least_injected_rad = 0.01;
    /// A wander of the dither's amplitude from one turn to the next that is smaller than this share of the readout's
    /// noise is not seen there, and the scenario has none [1].
    double least_wander = 0.05;
    /// Bounds of the keys readout.detector_noise_relative [1] and reader.reference_noise_arcsec of a scenario.
    double most_detector_noise = 0.1;
    double most_reference_noise_arcsec = 1e6;
    /// Effort: turns that are simulated in all.
    std::int64_t most_turns = 4'000'000;
    /// Simulations, however long they last, unless fewer are asked for; and most of them: the lowest and the highest of
    /// 39 hold 95 % of what one more would show.
    int fewest_simulations = 9;
    int most_simulations = 39;
    int base_simulations = 5;  ///< of the base model alone, of which figures show the mean

    /// Bands of the spectrum that are compared, of equal ratio, and fewest coefficients of each: a mean of four
    /// periodogram ordinates has a relative standard deviation of a half.
    int spectrum_bands = 30;
    std::size_t fewest_in_band = 4;

    /// Phases at which kicks are compared, harmonics of the phase that are fitted to the angle for them, and turns that
    /// have a line of their own in that fit, so that slow rates do not matter.
    std::size_t phase_points = 12;
    int kick_harmonics = 3;
    std::size_t turns_in_stretch = 256;
    /// Points of the figure of the rate over time, at most.
    std::size_t points_over_time = 1000;
    /// Lines that have a figure of their own, at most; how far it reaches to either side in resolutions of the record,
    /// and points in one of these.
    std::size_t most_lines_drawn = 4;
    int resolutions_beside_line = 20;
    int points_a_resolution = 8;

    /// Phases with fewer turns than this are not compared: their kicks are not determined.
    double fewest_at_phase = 4.0;
};

}  // namespace ringlock::closure
