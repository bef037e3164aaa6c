#include <limits>

#include "engine/core/units.hpp"
#include "engine/scenario/keys/sections.hpp"

namespace ringlock::scenario {

std::vector<Section> base_sections() {
    constexpr std::int64_t largest_integer = std::numeric_limits<std::int64_t>::max();
    constexpr const char* six_sigma = "six sigma must not reach zero";
    const Bounds none;
    return {
        {"gyro",
         "The optical cavity.",
         {
             key(RINGLOCK_KEY(gyro, scale_factor_arcsec), between(1e-3, 1e3, "real fringes are 0.1 to 10 arcsec"),
                 "K: arcsec of rotation per fringe, that is per 2 pi of optical phase."),
             key(RINGLOCK_KEY(gyro, lockin_threshold_deg_h),
                 between(0.0, 1e5, "0 is a gyro free of lock-in; no usable one locks above 28 deg/s"),
                 "Omega_L: half width of the lock-in band without dither."),
         }},
        {"dither",
         "The mechanical dither, a sinusoid before noise and effects.",
         {
             key(RINGLOCK_KEY(dither, frequency_hz),
                 between(1.0, 1e5, "mechanical dithers run at some 100 to 1000 Hz; the range leaves room for models"),
                 "Frequency; the default is 783.4 rad/s."),
             key(RINGLOCK_KEY(dither, peak_rate_deg_s), above(0.0, 1e4, "without dither there are no turns to follow"),
                 "Omega_D: peak rate of the case against the cavity."),
             key(RINGLOCK_KEY(dither, amplitude_wander_relative_rt_s), between(0.0, 0.1, "a dither is driven steadily"),
                 "Random walk of the amplitude from turn to turn, relative, per square root of a second, "
                 "from zero at the start."),
             key(RINGLOCK_KEY(dither, amplitude_drift_relative_per_h),
                 between(-100.0, 100.0, "a dither is driven steadily"),
                 "Steady change of the amplitude, relative to that at the start."),
         }},
        {"noise_injection",
         "Random noise on the dither angle, in arms that begin with noise_injected.",
         {
             key(RINGLOCK_KEY(noise_injection, model), none,
                 "turns: the angles of the turns are independent, which no drive can make; drive: "
                 "the force that drives the dithered body, a resonator, is noisy (docs/noise-injection.md)."),
             key(RINGLOCK_KEY(noise_injection, turn_phase_rms_rad),
                 between(0.0, 1e4, "a few rad randomise the phases of the turns"),
                 "Rms of the angle at the turns about its mean, in optical phase, stationary, behind resonator "
                 "and amplitude loop. Independent from turn to turn, 3 rad randomise the turns fully."),
             key(RINGLOCK_KEY(noise_injection, drive_noise_relative), between(0.0, 100.0, "the drive keeps its sense"),
                 "For a drive, instead of turn_phase_rms_rad: rms of the noise of the force over its mean; "
                 "0: not given."),
             key(RINGLOCK_KEY(noise_injection, resonator_q), between(20.0, 1e5, "a dither is driven at its resonance"),
                 "For a drive: quality factor Q of the resonator."),
             key(RINGLOCK_KEY(noise_injection, form), none,
                 "Noise of a drive. held: a random force is kept for hold_half_cycles; white: a random force is kept "
                 "for 1/32 of a half cycle; sinusoidal: the force is modulated at modulation_hz."),
             key(RINGLOCK_KEY(noise_injection, distribution), none,
                 "For a drive: "
                 "distribution of the levels of the force."),
             key(RINGLOCK_KEY(noise_injection, hold_half_cycles),
                 between<std::int64_t>(1, 10'000, "longer than the memory of any resonator"),
                 "For a drive with held noise: half cycles from one redraw to the next."),
             key(RINGLOCK_KEY(noise_injection, modulation_hz), above(0.0, 1e5, "a modulation goes up and down"),
                 "For a drive with sinusoidal noise: frequency of the modulation, which begins with a random phase."),
             key(RINGLOCK_KEY(noise_injection, amplitude_loop_hz),
                 between(0.0, 1e4, "an amplitude loop is slower than the dither"),
                 "Amplitude loop of a drive: frequency at which the open-loop gain of its integrator is 1. "
                 "The loop reduces noise of lower frequencies. 0: no loop."),
         }},
        {"readout",
         "The phase as the electronics read it; compensators have no other input.",
         {
             key(RINGLOCK_KEY(readout, model), none,
                 "ideal: phases and times without error; latched: quadrature detectors with noise, "
                 "sampled at the zero-rate point itself, quarter-fringe counter, noiseless pulses on a clock; "
                 "instrument: noisy comparators with hysteresis, a converter, a finite bandwidth, "
                 "and the zero-rate point found from the pulses."),
             key(RINGLOCK_KEY(readout, angle_output), none,
                 "interpolated: the angle from the quadrature phase; quarter_fringe: from the up/down counter alone, "
                 "in steps of K/4."),
             key(RINGLOCK_KEY(readout, clock_hz), zero_or(1e3, 1e12, "0 is continuous time"),
                 "Clock that times pulses and turns."),
             key(RINGLOCK_KEY(readout, detector_noise_relative),
                 between(0.0, 0.5, "beyond it the fringe cannot be followed"),
                 "Rms noise of each detector sample over the amplitude of the fringe."),
             key(RINGLOCK_KEY(readout, ellipse_correction), none,
                 "Estimate gain, offsets and orthogonality of the detectors from their own readings, "
                 "and correct them."),
             key(RINGLOCK_KEY(readout, phase_from), none,
                 "For the instrument: the phase at the zero-rate point from the sampled detectors alone, "
                 "or also from the times of the four nearest pulses on either side."),
             key(RINGLOCK_KEY(readout, comparator_noise_relative), between(0.0, 0.1, "a quarter fringe is 1.57"),
                 "For the instrument: rms noise at each comparator's input when it switches, "
                 "over the amplitude of the fringe."),
             key(RINGLOCK_KEY(readout, comparator_hysteresis_relative), between(0.0, 0.3, "a quarter fringe is 1.57"),
                 "For the instrument: comparators switch this far beyond zero, over the amplitude of the fringe."),
             key(RINGLOCK_KEY(readout, detector_bandwidth_hz), zero_or(1e4, 1e12, "0 is unlimited"),
                 "For the instrument: first-order low-pass of detectors and comparators."),
             key(RINGLOCK_KEY(readout, adc_bits), zero_or_whole(4, 24, "0 is a continuous converter"),
                 "For the instrument: bits of the converter of the detectors, "
                 "which spans 1.25 fringe amplitudes to either side."),
         }},
        {"calibration",
         "The constants that compensators and electronics assume for the gyros.",
         {
             key(RINGLOCK_KEY(calibration, threshold_error_relative),
                 between(-0.9, 9.0, "a threshold is positive and not unknown by powers of ten"),
                 "Assumed lock-in threshold over the true one, less one."),
         }},
        {"input",
         "Rate of the case about the input axis, without the dither.",
         {
             key(RINGLOCK_KEY(input, rate_deg_h), between(-1e7, 1e7, "the dither must reverse it"),
                 "The rate, or the first one of a sweep."),
             key(RINGLOCK_KEY(input, sweep_stop_deg_h), between(-1e7, 1e7, "the dither must reverse it"),
                 "Last rate of a sweep; not used where sweep_points is 1."),
             key(RINGLOCK_KEY(input, sweep_points), between<std::int64_t>(1, 100'000, "1 is no sweep"),
                 "Evenly spaced rates of the sweep, both ends included; each gets ensemble.gyros gyros."),
             key(RINGLOCK_KEY(input, profile_time_s), between(-1e9, 1e9, "30 years"),
                 "Times of a profile, from the start of the run, that takes the place of rate_deg_h: "
                 "linear between its points, constant beyond them. The rate that results are compared "
                 "with is its mean over the record."),
             key(RINGLOCK_KEY(input, profile_rate_deg_h), between(-1e7, 1e7, "the dither must reverse it"),
                 "Rates at these times."),
         }},
        {"environment",
         "Temperature of the gyros against that at the start, for effects that follow it: "
         "ramp t + swing sin(2 pi t / period).",
         {
             key(RINGLOCK_KEY(environment, temperature_ramp_k_per_h), between(-1000.0, 1000.0, "a gyro warming up"),
                 "Steady change of the temperature."),
             key(RINGLOCK_KEY(environment, temperature_swing_k),
                 between(0.0, 100.0, "more than the temperature swings in any day"),
                 "Amplitude of the periodic change."),
             key(RINGLOCK_KEY(environment, temperature_period_s), between(1.0, 1e9, "slower than the dither"),
                 "Period of that; the default is a day."),
             key(RINGLOCK_KEY(environment, profile_time_s), between(-1e9, 1e9, "30 years"),
                 "Times of a profile of the temperature, from the start of the run, "
                 "that takes the place of ramp and swing: linear between its points, constant beyond them."),
             key(RINGLOCK_KEY(environment, profile_temperature_k),
                 between(-1000.0, 1000.0, "no laser gyro works beyond it"),
                 "Temperatures at these times; only their difference from that at the start counts."),
         }},
        {"ensemble",
         "Number of gyros, simulated time, and spread over the gyros.",
         {
             key(RINGLOCK_KEY(ensemble, gyros),
                 between<std::int64_t>(1, 10'000'000, "a study needs a gyro, and each one's results are kept"),
                 "Independent gyros at each input rate."),
             key(RINGLOCK_KEY(ensemble, turn_ons), between<std::int64_t>(1, 1'000'000, "1: every gyro is another one"),
                 "This many consecutive gyros are one gyro that is switched on anew: its constants are drawn once, "
                 "initial phase and noises each time. Two or more show the repeatability from turn-on to turn-on."),
             key(RINGLOCK_KEY(ensemble, settle_s), between(0.0, 1e9, "30 years"),
                 "Simulated time of each gyro before its record begins, for compensators that learn."),
             key(RINGLOCK_KEY(ensemble, duration_s), above(0.0, 1e9, "30 years"), "Simulated time of each gyro."),
             key(RINGLOCK_KEY(ensemble, seed), between<std::int64_t>(0, largest_integer, "integers of TOML are signed"),
                 "Seed of every random number; the same seed gives the same result."),
             key(RINGLOCK_KEY(ensemble, initial_phase_spread_rad),
                 between(0.0, units::two_pi, "more than a whole fringe is the same"),
                 "Full width of the uniform distribution of the optical phase at the first turn; "
                 "0 starts all gyros alike."),
             key(RINGLOCK_KEY(ensemble, dither_asymmetry_sd_ratio),
                 between(0.0, 0.05, "six sigma must leave both half cycles"),
                 "Standard deviation of the dither asymmetry over the gyros."),
             key(RINGLOCK_KEY(ensemble, lockin_threshold_sd_relative), between(0.0, 0.16, six_sigma),
                 "Standard deviation of the lock-in threshold over the gyros, relative to its mean."),
             key(RINGLOCK_KEY(ensemble, dither_amplitude_sd_relative), between(0.0, 0.16, six_sigma),
                 "Standard deviation of the dither's peak rate over the gyros, relative to its mean."),
         }},
        {"propagation",
         "How the equation of motion is solved.",
         {
             key(RINGLOCK_KEY(propagation, method), none,
                 "turn_map: one exact map for each turn, the fast way; direct: "
                 "adaptive integration through every fringe, the reference."),
             key(RINGLOCK_KEY(propagation, direct_tolerance_rad),
                 between(1e-14, 1e-3, "double precision ends below it"),
                 "Error of a half cycle that the direct integrator allows."),
             key(RINGLOCK_KEY(propagation, turn_map_tolerance_rad),
                 between(1e-12, 1e-3, "the half turns that tables are made of are rounded there"),
                 "Interpolation error per turn that the turn map allows."),
         }},
        {"output",
         "Contents of the result file.",
         {
             key(RINGLOCK_KEY(output, sample_interval_s), above(0.0, 1e6, "it is rounded to whole outputs"),
                 "Time between samples of the decimated angle: whole dither cycles, or whole outputs of the reader."),
             key(RINGLOCK_KEY(output, angle_record), none,
                 "Store the angle record of every gyro and arm, not only its statistics."),
             key(RINGLOCK_KEY(output, angle_after_s), above(0.0, 1e9, "30 years"),
                 "Times since the start of the record at which the angle turned beyond the input's is given, "
                 "in addition to 1, 10 and 100 s; at the nearest dither cycle or output of the reader."),
             key(RINGLOCK_KEY(output, tau_s), above(0.0, 1e9, "30 years"),
                 "Averaging times at which Allan deviations are computed, in addition to the octaves "
                 "of the dither cycle or of an output of the reader; each is rounded to whole cycles or outputs."),
         }},
        {"specification",
         "Limits that a gyro must meet over ensemble.duration_s to pass, in a sweep at every rate; 0 is no limit. "
         "The result gives the share of the gyros that pass for each arm (docs/studies.md).",
         {
             key(RINGLOCK_KEY(specification, arw_deg_rt_h), between(0.0, 1e3, "no gyro is worse"),
                 "Largest angle random walk."),
             key(RINGLOCK_KEY(specification, bias_stability_deg_h), between(0.0, 1e6, "no gyro is worse"),
                 "Largest Allan deviation at the averaging time at_s."),
             key(RINGLOCK_KEY(specification, at_s), above(0.0, 1e9, "30 years"),
                 "Averaging time of bias_stability_deg_h; it is rounded to whole dither cycles "
                 "or outputs of the reader."),
             key(RINGLOCK_KEY(specification, rate_error_deg_h), between(0.0, 1e6, "no gyro is worse"),
                 "Largest magnitude of the mean output rate less the input rate, over the whole record."),
             key(RINGLOCK_KEY(specification, scale_factor_error_ppm), between(0.0, 1e6, "all of the rate"),
                 "Largest magnitude of a gyro's scale factor error: the slope of its straight line through the rates "
                 "of a sweep, output over input rate, less one."),
             key(RINGLOCK_KEY(specification, angle_error_arcsec), between(0.0, 1e9, "no gyro is worse"),
                 "Largest magnitude of the angle beyond the input's at after_s."),
             key(RINGLOCK_KEY(specification, after_s), above(0.0, 1e9, "30 years"),
                 "Time since the start of the record at which angle_error_arcsec holds."),
         }},
        {"record",
         "The record that `ringlock record` writes of one gyro over ensemble.duration_s.",
         {
             key(RINGLOCK_KEY(record, kind), none,
                 "turns: every zero-rate point as the electronics have it; samples: "
                 "increments of the angle that the reader puts out."),
             key(RINGLOCK_KEY(record, trajectory), none,
                 "The arm that is recorded; for turns, "
                 "an arm without compensator."),
             key(RINGLOCK_KEY(record, rate_hz), between(1e-3, 1e6, "faster than any output"), "Samples a second."),
             key(RINGLOCK_KEY(record, temperature_interval_s), between(1e-3, 1e6, "a thermometer is slow"),
                 "Time between rows of the temperature, if it changes."),
         }},
        {"reader",
         "The reader latches the angle for a record of samples, and for the arms of a study if output_hz is set, "
         "and removes the dither from it. Without this section the phase is known exactly at every tick "
         "and the dither is subtracted without error (docs/reader.md).",
         {
             key(RINGLOCK_KEY(reader, output_hz), zero_or(1e-3, 1e6, "faster than any output"),
                 "For `ringlock run`: rate at which every arm of every gyro is read; statistics are computed "
                 "from these angles. 0: the arms' angles at the turns of the dither, one per cycle, without a reader."),
             key(RINGLOCK_KEY(reader, latch_hz), zero_or(1e-3, 1e6, "faster than any counter is read"),
                 "Rate of the clock that latches the count; a whole multiple of the rate of the samples "
                 "or of output_hz. 0: the same rate."),
             key(RINGLOCK_KEY(reader, fraction), none,
                 "ideal: the phase itself; detectors: the counted quarter fringe and the quadrature detectors, "
                 "with their noise, ellipse and converter; none: whole quarter fringes."),
             key(RINGLOCK_KEY(reader, stripping), none,
                 "none: the dither stays in; whole_cycle: counts are latched once a dither cycle and resampled; "
                 "reference: a measured dither angle is subtracted; fir: a low-pass filter of linear phase; "
                 "notch: an adaptive canceller of the dither's frequency; reference+fir: both."),
             key(RINGLOCK_KEY(reader, reference_gain_error_relative),
                 between(-0.5, 0.5, "a larger error of the gain leaves more than half of the dither"),
                 "Error of the measured dither angle, relative."),
             key(RINGLOCK_KEY(reader, reference_delay_s), between(0.0, 1e-2, "a quarter of a slow dither's cycle"),
                 "Delay of the measured dither angle."),
             key(RINGLOCK_KEY(reader, reference_noise_arcsec), between(0.0, 1e6, "far more than the dither itself"),
                 "Rms noise of the measured dither angle, independent from tick to tick."),
             key(RINGLOCK_KEY(reader, reference_learning_s), between(0.0, 1e6, "a record is shorter"),
                 "Time constant with which gain and delay of the reference are estimated. 0: "
                 "they are taken as 1 and 0."),
             key(RINGLOCK_KEY(reader, fir_order), zero_or_whole(2, 100'000, "a longer filter would span many seconds"),
                 "Order of the low-pass filter, its taps less one; even. It delays by half of it. 0: "
                 "four cycles of the dither."),
             key(RINGLOCK_KEY(reader, fir_cutoff_hz), zero_or(1e-3, 1e6, "the latching rate is at most 1e6 Hz"),
                 "Frequency at which the low-pass filter's response is about one half. 0: a quarter of the dither's."),
             key(RINGLOCK_KEY(reader, notch_bandwidth_hz), above(0.0, 1e5, "the width of a notch is positive"),
                 "Bandwidth of the adaptive canceller between the points of half the power."),
         }},
        {"arms",
         "The arms, which are treatments of the same gyros; all arms share their random numbers gyro by gyro.",
         {
             key(
                 "arms", "names", [](auto& s) -> auto& { return s.arms; }, none,
                 "Arms of the run, in the order of the result."),
         }},
    };
}

}  // namespace ringlock::scenario
