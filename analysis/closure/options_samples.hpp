#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

/// Numbers that decide which effects are reported for a record of samples, one structure for each directory. "p" is a
/// probability by chance.
namespace ringlock::closure {

/// The record: known input, source of a resampled record, quantisation of the values, thermometer (samples/model).
struct SampleRecordOptions {
    /// The times of the known input are taken for the start or the middle of each interval, and not for its end, only
    /// if that explains more by this [chi-squared].
    double other_clock = 30.0;
    /// Adjacent increments lie on one straight line between two readings of the source if they differ by less than this
    /// share of the range of all increments: values have seven digits or more.
    double same_line = 1e-7;
    /// Fewest readings with a time of their own that determine the clock of a source.
    std::size_t fewest_readings = 20;
    /// Shortest interval of a source that straight lines can show [intervals of the record], so that lines contain
    /// whole intervals.
    double shortest_source_interval = 2.0;
    /// Times of readings are those of a clock if they deviate from its ticks by less [rms, intervals of the record].
    double off_clock = 1e-3;
    /// All levels must be a whole multiple of the step of a quantisation within this share of it.
    double off_lattice = 0.02;
    /// If the values have more levels than one in this number of values, they are digits that never repeat, and not
    /// quantised.
    std::size_t values_per_level = 4;
    /// Least length of the mean of exp(2 pi i value/step), the characteristic function of the values, for a
    /// quantisation coarser than the printed digits, and largest p of that length.
    double coarser_lattice_strength = 0.3;
    double coarser_lattice_p = 1e-6;
    /// Effort: a coarser quantisation is not searched if values are further from zero than this [printed steps], since
    /// every step is counted.
    std::int64_t most_levels = 200000;
    /// Temperatures are smoothed over the length of the record over this number to either side: a thermometer's noise
    /// is faster than any temperature.
    std::size_t smoothed_parts = 1000;
    /// The slope of a temperature is taken over the length of the record over this number to either side. Over single
    /// rows the noise after smoothing would be a large part of the slope.
    std::size_t slope_parts = 200;
    /// Rows on either side of a gap whose mean replaces the missing increments, and rows behind it that do not count
    /// until the filter has found the angle again.
    std::size_t rows_around_gap = 25;
    std::size_t rows_behind_gap = 20;
    /// Largest share of the samples that may be missing.
    double most_missing = 0.5;
};

/// Fits (samples/fit).
struct SampleFitOptions {
    /// A row of a resampled record is deterministic, given the rows before it, except for its digits, if its standard
    /// deviation is less than this share of the largest one;
    double deterministic_sd = 0.03;
    /// or if a rounding step larger by this factor
    double coarser_digits = 1.5;
    /// makes its standard deviation larger by this factor.
    double deterministic_growth = 1.01;
    /// The same factor for a row that mostly determines the deviation of readings from the source's straight lines, if
    /// that deviation is enlarged by coarser_digits. A source whose clock jitters makes it heavy-tailed.
    double blurred_growth = 1.15;
    /// A column whose part orthogonal to the model's own columns has no more than this share of its squares is one of
    /// them except for rounding [1]: the record does not distinguish it from the model's parameters. Several columns
    /// are independent of each other if the ratio of their pivots is larger than this.
    double least_independent_share = 1e-8;
    /// A resonance that is wider than this has no structure within the record's frequencies; the fit tries the model
    /// without it [rates of the record or of its source].
    double widest_resonance = 3.0;
    /// Effort: rounds of Fisher's scoring of the noise.
    int most_scorings = 25;
    /// Effort: most searches by a simplex on a part of the record, each from the end of the one before. A search that
    /// gains less than `searched_again` is the last [nats].
    int most_searches = 3;
    double searched_again = 0.5;
    /// A noise of a resampled record whose logarithm has a larger standard error than this is at zero, its lower bound:
    /// it does not contribute to the standard errors of others.
    double log_sd_at_zero = 1.5;
    /// The frequency of a cycle in products of innovations is refined between those of the spectrum below this p.
    double refined_cycle_p = 1e-3;
    /// Innovations are correlated with a witness at lags up to this on either side [s], but with no fewer and no more
    /// lags than these.
    double witness_lag_s = 0.25;
    int fewest_witness_lags = 2;
    int most_witness_lags = 40;
    /// Order of the autoregression that makes a witness white, so that its lags are independent.
    int witness_order = 24;
    /// Fewest windows of lags far from zero, where innovations and witness are independent, that determine the
    /// distribution by chance of the sum of squares over the lags.
    double fewest_far_windows = 20.0;
    /// The part of a motion that the witness does not predict is no slower than this share of the motion's centre
    /// frequency: near zero frequency it would be a random walk of the rate, which would then not be searched.
    double slowest_of_motion = 0.2;
    /// Aliases of a line that are listed, first those in the range of frequencies of dithers [Hz]; two within
    /// `same_alias` are one [relative to the rate of the readings].
    std::size_t aliases_listed = 4;
    double slowest_dither_hz = 100.0;
    double fastest_dither_hz = 1000.0;
    double same_alias = 1e-6;
    /// A resonance at half the rate of the record that is narrower than this share of the rate is a line, and no part
    /// of a motion.
    double narrowest_at_half_rate = 0.1;
    /// A motion whose resonance gains less than this without its witness does not stand out from the noise [nats]:
    /// coherence, rms, centre and width have no standard error then.
    double motion_stands_out = 20.0;
    /// The standard error of a coherence is that of Bendat and Piersol for independent spectra if the amplitude that
    /// the witness does not predict has a relative standard error below this. Otherwise it follows from the error of
    /// that power.
    double small_relative_sd = 0.25;
    /// A motion is fitted again, after an effect was added, while that gains more [nats].
    double motion_refitted = 1.0;
    /// Times at which a record is searched for a step before the most likely one is refined, and times in a gap between
    /// rows that count.
    std::size_t positions_of_step = 80;
    std::size_t positions_in_gap = 32;
    /// Effort: rounds in which each step is placed again with the others in the model.
    int most_step_rounds = 3;
    /// Steps of values that are smaller than this share of the standard deviation are not visible in held-out errors.
    double fine_lattice = 0.02;
};

/// The search for lines (samples/fit/line_*).
struct SampleLineOptions {
    /// With fewer cycles over the record a line is a rate that changes.
    double fewest_cycles = 8.0;
    /// Lines above this chi-squared are significant beyond chance and compete by power: the strongest is added first,
    /// since a strong line raises the level about itself.
    double certain = 1000.0;
    /// Number of searches among which the most likely line is chosen: lines of constant frequency, lines that drift
    /// slowly, and lines with any drift.
    double kinds = 3.0;
    /// Numbers of pieces of the record, few and many, over which drifting lines are tracked: a line must stay in its
    /// bin for the length of a piece. Lines on a curve are tracked over many pieces.
    std::array<std::size_t, 2> pieces = {8, 64};
    /// Shortest piece whose spectrum distinguishes a line from the level about it [rows], and fewest pieces with rows
    /// that count.
    std::size_t shortest_piece = 256;
    double fewest_pieces = 3.0;
    /// Coefficients of the frequency track of a line, a polynomial of time: the frequency and its derivatives up to the
    /// fifth. A dither follows the temperature of its springs, evenly over minutes, on a curve over an hour.
    std::size_t most_coefficients = 6;
    /// Largest p of the power along tracks over pieces for a line that is not phase-coherent.
    double scattered_p = 1e-6;
    /// Excess of the power in pieces over that of a line that may be chance [chi-squared].
    double much_scattered = 60.0;
    /// A line is not phase-coherent if more than one part in this number of the power in pieces remains when the most
    /// likely line is removed.
    double left_parts = 3.0;
    /// Distance within which the residual of a line belongs to that line, and other lines may be artefacts of it [Hz].
    double adjacent_hz = 1.0;
    /// Cost of each coefficient of a curved frequency track [chi-squared]: 6 nats, as for a search over half a cycle a
    /// piece.
    double bend = 12.0;
    /// Largest drifts that are tracked over the whole record, of either sign [cycles over the record].
    int slow_drift_cycles = 16;
    /// Drifts that are tracked about a line that shows in pieces [cycles].
    double near_cycles = 64.0;
    /// Larger drifts of a declared dither are left to the search over all frequencies [cycles].
    double declared_drift_cycles = 128.0;
};

/// Kicks of the lock-in at the turns of the declared dither (samples/declared/turn_pattern).
struct SampleTurnOptions {
    /// With more turns in a sample their number is nearly the same in all samples.
    double most_turns_a_row = 40.0;
    /// The turns are searched if the squares of the innovations have a line at their alias with less than this p, and
    /// belong to the base model if that gains more than `least_gain` [nats].
    double seen_p = 1e-3;
    double least_gain = 6.0;
    /// A line of fewer cycles over twice the record is a noise that changes.
    std::size_t fewest_cycles = 16;
    /// Lateness of the turns of a noisy drive that is tried, rms [s]; the likeliest is taken.
    std::array<double, 4> late_s = {0.0, 5e-6, 15e-6, 45e-6};
    double most_late_turns = 0.2;  ///< in turns; with more the pattern vanishes
    /// Rows of the response of the innovations to the error of one reading, and most rows of a sum that still shows the
    /// distribution of that error.
    std::size_t response_rows = 4000;
    std::size_t longest_sum = 1000;
    /// Shares of the white rate's variance in kicks that are tried; the likeliest is taken. The rest is quantum noise.
    std::array<double, 9> shares = {0.4, 0.7, 0.85, 0.93, 0.97, 0.985, 0.993, 0.997, 0.999};
    /// Shares of the readings' errors that are noise of the dither, if the reader leaves it, and correlations of its
    /// amplitudes from turn to turn, as those of resonators of some Q, that are tried; the likeliest are taken.
    std::array<double, 13> dither_shares = {0.2,   0.4,   0.6,    0.8,     0.9,      0.95,    0.98,
                                            0.995, 0.999, 0.9997, 0.99992, 0.999985, 0.999998};
    double dither_first_share = 0.9;  ///< for the search of frequency and place: larger shares show them from near only
    /// Effort: rounds in which frequency, place, share and memory are refined, until one gains less than
    /// `dither_settled` [nats].
    int dither_rounds = 8;
    double dither_settled = 0.1;
    double dither_place_step = 0.01;       ///< of the first round, in turns; each round halves it
    double dither_asymmetry_step = 0.004;  ///< the same for the turn in the middle of a cycle
    std::array<double, 10> dither_memories = {0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.985, 0.992};
    /// Start values for the sidebands of a noisy drive: their widths over the frequency of the dither, one over the Q
    /// of its resonator, and their rms over that of the innovations.
    std::array<double, 3> sideband_widths = {0.002, 0.01, 0.05};
    double sideband_first_rms = 0.5;
    /// Amplitude noise of a noisy drive, relative to the amplitude: start value, and largest value.
    double late_first_rms = 0.02;
    double late_most_rms = 0.3;
    double late_least_gain = 0.5;  ///< of the log-likelihood [nats]
};

/// Error of counts at the zero crossings of the dither (samples/declared/count_error).
struct SampleCountErrorOptions {
    /// Least number of steps of the count over the record: with fewer there is no line.
    double fewest_steps = 8.0;
    /// Start values for the width of the first harmonic [Hz]; the likeliest result is taken.
    std::array<double, 3> first_widths_hz = {0.03, 0.3, 3.0};
    /// Effort: most harmonics in the model, as long as each gains the first number [nats]; and the least gain of all
    /// together.
    int most_harmonics = 5;
    double least_gain_of_harmonic = 1.0;
    double least_gain = 6.0;
    /// Effort: number of simulated records that determine the effect of counts that jump on residual tests.
    int simulated_records = 12;
};

/// Lines and noise that belong to a declared reader (samples/declared/declared_reader).
struct SampleReaderOptions {
    /// Lines at the dither and at this number of its harmonics can be residues of the reader.
    int harmonics = 5;
    /// Fewest half cycles of the dither in a sample, if the reader leaves the noise of the dither.
    double least_turns_a_row = 1.02;
    /// Largest ratio of such a line to the declared residue, which is that of a steady dither.
    double residue_margin = 1.5;
    /// A harmonic of a dither that the reader leaves is smaller than this share of the dither.
    double most_harmonic = 0.05;
};

/// Candidates by score tests (samples/screen).
struct SampleScreenOptions {
    /// Multiples of the beat of the input rate with the dither that are searched, and fewest cycles of the beat over
    /// the record.
    int beat_multiples = 4;
    double beat_cycles = 8.0;
    /// In a record with a beat a line counts as part of it unless its rate exceeds the device's largest by this factor.
    double beyond_beat = 2.0;
    /// Scores of slow rates are divided by the ratio by which sums of stretches scatter more than those of white
    /// innovations. A stretch has the rows of the record over `slow_parts`, but at least `slow_rows`, of which
    /// `slow_share` must count; there must be more than `slow_sums` stretches.
    std::size_t slow_rows = 16;
    std::size_t slow_parts = 1000;
    double slow_share = 0.5;
    double slow_sums = 20.0;
    /// A step is a candidate below this p.
    double step_p = 0.01;
    /// Random rates are fitted only if `slow_cosines` cosines over the record explain it with less than this p: sums
    /// over long stretches must scatter more than the white noises explain.
    double random_rate_p = 0.05;
    int slow_cosines = 12;
    /// Lines below this p are also tried as lines that are not phase-coherent.
    double line_p = 0.01;
    /// Lines below this p are refined by a regression, since the level of a spectrum about a line is itself random.
    double refined_line_p = 0.2;
    /// A base hardly moves above this [Hz]: a line there is one of the output.
    double fast_hz = 30.0;
    /// Lines within this number of cycles over the record of a line in the model are residuals of it.
    double known_line_cycles = 64.0;
    /// Lines that are this number of cycles over the record apart are two.
    double resolved_cycles = 4.0;
    /// A smaller drift, of either sign, counts as no drift [cycles over the record].
    double least_drift_cycles = 1.0;
    /// Shares of the level of output lines for lines with any drift, and, near the declared dither, for lines of
    /// constant frequency and for lines that drift: a declaration makes these likely.
    double drifting_share_if_declared = 0.1;
    double declared_share = 0.45;
    /// Shares of the level near the declared dither for its harmonics: the residue of the dither itself is the most
    /// likely.
    std::array<double, 3> harmonic_shares = {0.7, 0.15, 0.15};
    /// Rates from which a record may be resampled [of its own rate]: beyond these the variance of interpolated readings
    /// hardly repeats. They differ by the frequency that repeats from multiples up to `most_multiple`.
    double slowest_source = 0.3;
    double fastest_source = 4.5;
    int most_multiple = 4;
    /// Fewest and most sources that are fitted in full; between these, all sources that are within `likely_source` of
    /// the most likely one by a part of the record, with noises that are not fitted, so that they may be wrong by tens
    /// of nats.
    std::size_t fewest_sources = 3;
    std::size_t most_sources = 7;
    double likely_source = 40.0;
    /// Effort: positions of the record's start within the interval of a source from which fits start. A record's own
    /// white errors, which may be small against those of its rates, are then multiplied by `error_step` while that is
    /// likelier, at most `most_error_steps` times.
    int phases_of_source = 8;
    double error_step = 1.5;
    int most_error_steps = 10;
};

/// Candidates compared with each other and with residual tests (samples/loop/contest).
struct SampleContestOptions {
    /// A slow rate or a line is fitted in full below this p, even if its score does not pass: scores use the fitted
    /// noise, which may have absorbed it.
    double worth_looking = 0.01;
    /// A step that gains more is placed again [nats], since its time was estimated with a noise that included the step.
    double placed_again = 50.0;
    /// Candidates of resampling that are fitted first, the likeliest with either kind of errors. The others explain
    /// nearly the same and take long: they are omitted if the evidence of the first is less than `far` of the largest.
    std::size_t first_sources = 2;
    double far = 0.5;
    /// Candidates in addition to Options::most_finalists that are fitted in full for samples.
    std::size_t more_finalists = 2;
    /// Effects from which sets of two or three start.
    std::size_t set_starts = 4;
    /// Residual tests that are fitted and compete with the effects, in addition to jumps and rates that follow another
    /// column.
    std::size_t most_competing_tests = 4;
    /// Resampling is blurred if interpolated readings deviate from the straight line by more than this share of their
    /// errors. Then the variance varies by less than half, as any variance may, and resampling must explain more than a
    /// free variance by a tie.
    double blurred = 0.3;
    /// The path of jumps is found by a greedy search over stretches, and loses a part of their evidence: a random rate
    /// must explain more than jumps by a tie, and by this share of its own evidence.
    double lost_of_jumps = 0.1;
    /// Length of a record from which a trend is distinguished from a random rate that does not pass by itself [s]. In
    /// five seconds a random walk shows no more than one slow movement.
    double trend_determined_s = 30.0;
    /// Sources of a resampled record are the same within this [of the record's rate].
    double same_source = 1e-3;
    /// Sources faster than this are not distinguished from others that make the same pattern [of the record's rate].
    double distinguished_up_to = 2.0;
};

/// Residual tests (samples/residual).
struct SampleResidualOptions {
    /// A line is refined before its test counts below this p.
    double line_p = 0.01;
    /// Stretches that are compared for a line whose amplitude is not constant.
    std::size_t line_stretches = 20;
    /// Patterns of the place in the record are searched modulo 2 up to this.
    std::size_t most_modulo = 16;
    /// Fewest rows with one remainder for which their mean and size are compared.
    double fewest_in_pattern = 20.0;
    /// Values with steps larger than this share of the standard deviation are not normal, and sums of them are tested
    /// instead.
    double coarse_lattice = 0.2;
    /// Largest number of equal values at the end of their range that is no sign of clipping.
    int most_ties = 4;
    /// Stretches of the record are outlier stretches if their variance is more than this times the usual one,
    double disturbed_variance = 2.0;
    /// if that is as improbable as this,
    double disturbed_p = 1e-6;
    /// and if they have at least this number of informative rows, and the record over `disturbed_parts`.
    std::size_t disturbed_rows = 50;
    std::size_t disturbed_parts = 500;
    /// Cost of a rate of two states: its step and two probabilities [nats].
    double price_of_states = 3.0;
    /// Cost of the exact time of each jump, which need not be the end of a stretch [nats].
    double price_of_jump = 2.0;
    /// Stretches of the record that may have one of two levels.
    std::size_t level_stretches = 120;
    /// Resolution of the time of a jump, in parts of a stretch.
    std::size_t jump_positions = 50;
    /// Polynomials of time up to this degree.
    std::size_t polynomial_degrees = 6;
    /// Number of times at which a step of the rate is tested.
    std::size_t step_positions = 40;
    /// Number of slow oscillations, each with a quarter of a period over the record more than the one before.
    std::size_t slow_swings = 32;
    /// Number of time constants of a rate that settles, from the length of the record down, each shorter by this
    /// factor.
    std::size_t settling_constants = 14;
    double settling_factor = 1.4;
    /// Lags with which a rate may follow the temperature, lengths over which the input's slope and noise are evaluated,
    /// and lags with which a rate may follow an acceleration.
    std::size_t temperature_lags = 7;
    std::size_t input_reaches = 5;
    std::size_t acceleration_lags = 4;
};

/// Readings in coarse steps (samples/rounded).
struct SampleRoundedOptions {
    /// Rounding shows the angle if its first harmonic keeps more than this (Widrow and Kollar, "Quantization Noise",
    /// 2008, chapter 5).
    double rounding_shows = 0.01;
    /// Effort: filters whose mixture gives the likelihood of rounded increments: this number for each standard
    /// deviation in a step, doubled from the fewest to the most. A filter's number has one byte, so 256 is the largest
    /// possible number.
    double filters_per_step = 8.0;
    std::size_t fewest_filters = 64;
    std::size_t most_filters = 256;
    /// Least white noise of the angle with which the model starts after the variance of steps has been subtracted
    /// [steps].
    double least_angle_noise = 0.02;
    /// Effort at the start: the most likely noises are found on the first part of the record [rows] by at most
    /// `steps_at_start` steps. Then the model is fitted again in rounds, each after some imputations of the
    /// increments.
    std::size_t first_look = 6000;
    int steps_at_start = 12;
    int rounds_at_start = 2;
    int draws_a_round = 2;
    /// Effort: steps towards the maximum of the likelihood before increments are imputed, the same from a model without
    /// the random walk that is added, and before figures are reported.
    int most_steps = 2;
    int steps_with_walk = 6;
    int steps_of_figures = 4;
    /// Imputations over which reported figures and their standard errors are averaged. The information that rounding
    /// hides is the scatter between imputations, which eight determine to a quarter.
    int draws_of_figures = 8;
    /// Stretches of the record whose means are compared.
    std::size_t stretches = 16;
    /// Means of stretches scatter more than white noise explains if their variance is larger by this factor: with 15
    /// degrees of freedom one case in a thousand.
    double wanders = 2.5;
    /// Increments are imputed with a random walk that the model lacks if that is likelier by more [nats].
    double drawn_with_walk = 12.0;
    /// With very large steps few of the filters contain the moments at which the angle crosses a step: the variance
    /// that they predict may be wrong by this share of it.
    double filters_off = 0.1;
};

/// The loop (samples/loop).
struct SampleLoopOptions {
    /// If a larger share of the record is in outlier stretches, it is typical of the record, and nothing is excluded.
    double most_disturbed = 0.6;
    /// Most iterations of the loop, which starts again if an effect that was added explains outlier stretches.
    int most_looks = 3;
    /// The loop starts again if at least this share of the rows in outlier stretches is explained.
    double restored = 0.05;
    /// A narrow motion remembers the part at the start that the witness does not predict, for this number of times the
    /// witness's lags. These rows do not count, up to one part in `edge_parts` of the record at either end.
    std::size_t remembered_lags = 4;
    std::size_t edge_parts = 20;
    /// Quantisation that adds less than this share to the variance has no consequences, and is not reported.
    double negligible_steps = 1e-3;
    /// A quantisation is coarser than the printed digits if its step is larger by this factor.
    double coarser_than_printed = 1.5;
    /// Most fits of a motion after each effect that is added.
    int most_motions = 6;
    /// Imputations of rounded increments after each effect that is added.
    int draws = 2;
    /// Residual tests that are fitted to locate the structure that the model does not explain.
    std::size_t most_tests = 4;
    /// Most placeholders that are added for structure which the library does not have, so that other effects can be
    /// found.
    int most_placeholders = 3;
    /// A line is not reported if its changes, or another line next to it, have more than this share of its power.
    double unsteady_line = 0.02;
    /// Length of a record from which a motion of the case is distinguished from a line and from a random rate [s]: some
    /// twenty correlation times of a resonance that is half a hertz wide.
    double motion_determined_s = 30.0;
};

/// Numbers that decide which effects are reported for a record of samples.
struct SampleOptions {
    /// Relative error of a declared dither frequency [1]. With a larger one the dither and its harmonics would cover
    /// half of all frequencies.
    double declared_dither_error = 0.002;
    /// Largest drift of a dither, relative to its frequency [1/s]: springs of steel soften by 2.5e-4 a kelvin, the
    /// resonance by half of that, while a gyro warms up by a kelvin a minute.
    double dither_drift_per_s = 2e-6;

    SampleRecordOptions record = {};
    SampleFitOptions fit = {};
    SampleLineOptions lines = {};
    SampleTurnOptions turns = {};
    SampleReaderOptions reader = {};
    SampleCountErrorOptions count_error = {};
    SampleScreenOptions screen = {};
    SampleContestOptions contest = {};
    SampleResidualOptions residual = {};
    SampleRoundedOptions rounded = {};
    SampleLoopOptions loop = {};
};

}  // namespace ringlock::closure
