#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

/// Numbers that decide what is named on a record of samples, room by room. "p" is a probability by chance.
namespace ringlock::closure {

/// The record: known input, source of a resampled record, lattice of the values, thermometer (samples/model).
struct SampleRecordOptions {
    /// The clock of the instrument that tells the input is taken to mean the start or the middle of each interval, and
    /// not its end, only where that explains more by this [chi-squared].
    double other_clock = 30.0;
    /// Neighbouring increments lie on one straight line between two readings of the source where they differ by less
    /// than this share of the range of all increments: values keep seven digits and more.
    double same_line = 1e-7;
    /// Fewer readings with a time of their own do not give the clock of a source.
    std::size_t fewest_readings = 20;
    /// Shortest interval of a source that straight lines can show [intervals of the record], so that lines have whole
    /// intervals.
    double shortest_source_interval = 2.0;
    /// Times of readings are those of a clock where they are off its ticks by less [rms, intervals of the record].
    double off_clock = 1e-3;
    /// All levels must be a whole multiple of the step of a lattice within this share of it.
    double off_lattice = 0.02;
    /// Levels of more than one part in so many of all values are digits that never repeat, and no lattice.
    std::size_t values_per_level = 4;
    /// A coarser lattice beneath the printed digits must leave so much of the characteristic function of the values
    /// (the length of the mean of exp(2 pi i value/step)), and be as improbable by chance.
    double coarser_lattice_strength = 0.3;
    double coarser_lattice_p = 1e-6;
    /// Effort: a coarser lattice is not looked for where values reach further from zero than this [printed steps], for
    /// every step is counted.
    std::int64_t most_levels = 200000;
    /// Half of the length over which temperatures are smoothed is the record over this: a thermometer's noise is faster
    /// than any temperature.
    std::size_t smoothed_parts = 1000;
    /// Half of the length over which a temperature's slope is taken is the record over this. Over single rows the noise
    /// that smoothing leaves would be a good part of the slope.
    std::size_t slope_parts = 200;
    /// Rows on either side of a gap whose mean is put in the place of the missing increments, and rows behind it that
    /// count for nothing until the filter has found the angle again.
    std::size_t rows_around_gap = 25;
    std::size_t rows_behind_gap = 20;
    /// Largest share of the samples that may be missing.
    double most_missing = 0.5;
};

/// Fits (samples/fit).
struct SampleFitOptions {
    /// A row of a resampled record is settled by the rows before it, but for its digits, where its standard deviation
    /// is less than this share of the largest one;
    double settled_sd = 0.03;
    /// or where digits that are coarser by this factor
    double coarser_digits = 1.5;
    /// make its standard deviation larger by this factor.
    double settled_growth = 1.01;
    /// The same factor of a row that knows little more than how far readings are off the source's straight lines, where
    /// that is taken for larger by coarser_digits. A source whose clock jitters makes this error heavy-tailed.
    double blurred_growth = 1.15;
    /// A column of whose squares no more than this share is left when the model's own columns have been taken out is
    /// one of them but for rounding [1]: the record cannot tell it from the model's parameters. Several columns are
    /// independent of each other where the ratio of their pivots is larger than this.
    double told_apart = 1e-8;
    /// A resonance that is wider than this has no shape within the record's frequencies, and is tried as none [rates of
    /// the record or of its source].
    double widest_resonance = 3.0;
    /// Effort: rounds of Fisher's scoring of the noise.
    int most_scorings = 25;
    /// Effort: searches by a simplex on a part of the record, each from the end of the one before; there are no more
    /// after one that gains less than this [nats].
    int most_searches = 3;
    double searched_again = 0.5;
    /// A noise of a resampled record whose logarithm has a larger standard error than this stands at zero, its lower
    /// bound: it does not count in the standard errors of others.
    double log_sd_at_zero = 1.5;
    /// The frequency of a cycle in products of innovations is refined between those of the spectrum below this p.
    double refined_cycle_p = 1e-3;
    /// Innovations are held against a witness at lags up to this on either side [s], but at no fewer and no more lags
    /// than these.
    double witness_lag_s = 0.25;
    int fewest_witness_lags = 2;
    int most_witness_lags = 40;
    /// Order of the autoregression that makes a witness white, so that its lags are independent.
    int witness_order = 24;
    /// Fewest windows of lags far from zero, where innovations and witness have nothing in common, that tell how the
    /// sum of squares over the lags is spread by chance.
    double fewest_far_windows = 20.0;
    /// What a witness leaves of a motion is no slower than this share of the motion's centre frequency: at next to
    /// nothing hertz it would be a random walk of the rate, which would then not be looked for.
    double slowest_of_motion = 0.2;
    /// Aliases of a line that are listed, those at frequencies that gyros are dithered at before others [Hz]; two
    /// within `same_alias` are one [of the rate of the readings].
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
    /// The standard error of a coherence is that of Bendat and Piersol for independent spectra where the amplitude that
    /// the witness leaves has a relative standard error below this; it is in proportion to the power left elsewhere.
    double small_relative_sd = 0.25;
    /// A motion is fitted again, beside an effect that was added, while that gains more [nats].
    double motion_refitted = 1.0;
    /// Places at which a record is searched for a step before the likeliest is refined, and places in a gap between
    /// rows that count.
    std::size_t places_of_a_step = 80;
    std::size_t places_in_a_gap = 32;
    double dither_first_share =
        0.9;  ///< where frequency and place are searched: a larger one shows them from near only
    /// Effort: rounds in which each step is placed again with the others in the model.
    int most_step_rounds = 3;
    /// Steps of values that are smaller than this share of the standard deviation do not show in held-out errors.
    double fine_lattice = 0.02;
};

/// The search for lines (samples/fit/line_*).
struct SampleLineOptions {
    /// Below so many cycles over the record a line is a rate that changes.
    double fewest_cycles = 8.0;
    /// Of lines above this chi-squared nothing is left to chance: the one of most power is taken first, since a strong
    /// line raises the level about itself.
    double certain = 1000.0;
    /// Lines that keep their frequency, that drift slowly and that drift by anything are searched: the likeliest is one
    /// of so many.
    double kinds = 3.0;
    /// Pieces of the record over which lines that drift are tracked, few and many: a line must stay in its bin for the
    /// length of a piece. Lines on a curve are followed by the many.
    std::array<std::size_t, 2> pieces = {8, 64};
    /// Shortest piece whose spectrum tells a line from the level about it [rows], and fewest pieces with rows that
    /// count.
    std::size_t shortest_piece = 256;
    double fewest_pieces = 3.0;
    /// Coefficients of the course of a line's frequency, a polynomial of time: the frequency and its derivatives up to
    /// the fifth. A dither follows the temperature of its springs, evenly over minutes, on a curve over an hour.
    std::size_t most_coefficients = 6;
    /// Power along tracks over pieces must be as improbable to be a line that does not keep its phase.
    double scattered_p = 1e-6;
    /// Power in pieces that a line does not have may be chance up to this [chi-squared].
    double much_scattered = 60.0;
    /// Power in pieces belongs to a line that does not keep its phase where more than one part in so many of it is left
    /// when the likeliest line has been taken off.
    double left_parts = 3.0;
    /// What is left of a line, or made of one, is nearer to it than this [Hz].
    double beside_hz = 1.0;
    /// Price of each coefficient of a line's course on a curve [chi-squared]: 6 nats, as for a search over half a cycle
    /// a piece.
    double bend = 12.0;
    /// Drifts that are followed over the whole record, either way [cycles over the record].
    int slow_drift_cycles = 16;
    /// Drifts that are followed about a line which shows in pieces [cycles].
    double near_cycles = 64.0;
    /// Drifts of a declared dither beyond this are left to the search over all frequencies [cycles].
    double declared_drift_cycles = 128.0;
};

/// Kicks of the lock-in at the turns of the declared dither (samples/declared/turn_pattern).
struct SampleTurnOptions {
    /// With more turns in a sample their number is as good as the same in all.
    double most_turns_a_row = 40.0;
    /// The turns are looked for where the squares of the innovations have a line at their alias with less than this p,
    /// and belong to the base where that gains more [nats].
    double seen_p = 1e-3;
    double least_gain = 6.0;
    /// A line of fewer cycles over twice the record is a noise that changes.
    std::size_t fewest_cycles = 16;
    /// Times by which the turns of a noisy drive are late, rms [s]: the likeliest is taken.
    std::array<double, 4> late_s = {0.0, 5e-6, 15e-6, 45e-6};
    double most_late_turns = 0.2;  ///< in turns; beyond, nothing is left of the pattern
    /// Rows of the response of the innovations to one reading's error, and most rows of a sum in which its distribution
    /// shows.
    std::size_t response_rows = 4000;
    std::size_t longest_sum = 1000;
    /// Share of the white rate's variance that comes in kicks: the likeliest is taken. The rest is quantum noise.
    std::array<double, 9> shares = {0.4, 0.7, 0.85, 0.93, 0.97, 0.985, 0.993, 0.997, 0.999};
    /// Share of the readings' errors that is noise of the dither where the reader leaves it, and correlation of its
    /// amplitudes from turn to turn, as that of a resonator of some Q: the likeliest are taken.
    std::array<double, 13> dither_shares = {0.2,   0.4,   0.6,    0.8,     0.9,      0.95,    0.98,
                                            0.995, 0.999, 0.9997, 0.99992, 0.999985, 0.999998};
    double dither_first_share =
        0.9;  ///< where frequency and place are searched: a larger one shows them from near only
    /// Effort: rounds in which frequency, place, share and memory are refined, until one gains less than this [nats].
    int dither_rounds = 8;
    double dither_settled = 0.1;
    double dither_place_step = 0.01;       ///< the first, in turns; each round halves it
    double dither_asymmetry_step = 0.004;  ///< the same of the turn in the middle of a cycle
    std::array<double, 10> dither_memories = {0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.985, 0.992};
    /// Of the sidebands that a noisy drive makes: widths over the frequency of the dither, one over the Q of its
    /// resonator, and rms over that of the innovations, from which fits begin.
    std::array<double, 3> sideband_widths = {0.002, 0.01, 0.05};
    double sideband_first_rms = 0.5;
    /// Of the amplitude of a noisy drive over the amplitude itself: from which fits begin, and the largest.
    double late_first_rms = 0.02;
    double late_most_rms = 0.3;
    double late_least_gain = 0.5;  ///< of the log-likelihood
};

/// Error of counts at the zero crossings of the dither (samples/declared/count_error).
struct SampleCountErrorOptions {
    /// Steps of the count over the record, at least: fewer are no line.
    double fewest_steps = 8.0;
    /// Widths of the first harmonic from which fits begin [Hz]: the likeliest is taken.
    std::array<double, 3> first_widths_hz = {0.03, 0.3, 3.0};
    /// Effort: harmonics that are modelled, while each gains so much [nats]; and the least gain of all together.
    int most_harmonics = 5;
    double least_gain_of_harmonic = 1.0;
    double least_gain = 6.0;
    /// Effort: records that are simulated to see how residual tests react to counts that jump.
    int simulated_records = 12;
};

/// What a declared reader accounts for (samples/declared/declared_reader).
struct SampleReaderOptions {
    /// Lines at the dither and at so many of its harmonics can be residues of the reader.
    int harmonics = 5;
    /// Half cycles of the dither in a sample, at least, where the reader leaves the noise of the dither.
    double least_turns_a_row = 1.02;
    /// Such a line has at most so many times the declared residue, which is that of a steady dither.
    double residue_margin = 1.5;
    /// A harmonic of a dither that was left in is smaller than this share of it.
    double most_harmonic = 0.05;
};

/// Candidates by score tests (samples/screen).
struct SampleScreenOptions {
    /// Multiples of the beat of the input rate with the dither that are looked for, and cycles of it over the record
    /// that it must have.
    int beat_multiples = 4;
    double beat_cycles = 8.0;
    /// In a record with a beat a line counts as part of it unless its rate exceeds the device's largest by this
    /// factor.
    double beyond_beat = 2.0;
    /// Scores of slow rates are weakened by how much more the sums of stretches move than white innovations would:
    /// stretches of the record over `slow_parts` rows, of `slow_rows` at least, of which `slow_share` must count, and
    /// only with more than `slow_sums` of them.
    std::size_t slow_rows = 16;
    std::size_t slow_parts = 1000;
    double slow_share = 0.5;
    double slow_sums = 20.0;
    /// A step is a candidate below this p.
    double step_p = 0.01;
    /// Random rates are fitted only where `slow_cosines` cosines over the record explain it with less than this p: sums
    /// over long stretches must move more than the white noises let them.
    double random_rate_p = 0.05;
    int slow_cosines = 12;
    /// Lines below this p are looked at as lines that do not keep their phase.
    double line_p = 0.01;
    /// Lines below this p are refined by a regression: the level of a spectrum about a line is itself a random number.
    double refined_line_p = 0.2;
    /// A base hardly moves above this [Hz]: a line there is one of the output.
    double fast_hz = 30.0;
    /// Lines within so many cycles over the record of one that is in the model are what it left.
    double known_line_cycles = 64.0;
    /// Lines that are so many cycles over the record apart are two.
    double resolved_cycles = 4.0;
    /// A drift below so many cycles over the record, either way, is none.
    double least_drift_cycles = 1.0;
    /// Share of the level of output lines that goes to lines which drift anywhere, and to each of lines near the
    /// declared dither that keep their frequency and that drift: a declaration makes these likely.
    double drifting_share_if_declared = 0.1;
    double declared_share = 0.45;
    /// How the share near the declared dither goes to its harmonics: most is left of the dither itself.
    std::array<double, 3> harmonic_shares = {0.7, 0.15, 0.15};
    /// Rates that a record may be resampled from [of its own rate]: beyond these the variance of interpolated readings
    /// hardly repeats. They are at a distance of the frequency that repeats from multiples up to `most_multiple`.
    double slowest_source = 0.3;
    double fastest_source = 4.5;
    int most_multiple = 4;
    /// Sources that are fitted in full: at least and at most so many, and between these all that are as likely by a
    /// part of the record, with noises that are not fitted, which may be wrong by tens of nats.
    std::size_t fewest_sources = 3;
    std::size_t most_sources = 7;
    double likely_source = 40.0;
    /// Effort: places of the record's start within the interval of a source from which fits start. A record's own white
    /// errors, which may be small against those of its rates, are then raised by `error_step` while that is likelier,
    /// `most_error_steps` times at most.
    int places_of_source = 8;
    double error_step = 1.5;
    int most_error_steps = 10;
};

/// Candidates compared with each other and with residual tests (samples/loop/contest).
struct SampleContestOptions {
    /// A slow rate or a line is fitted in full below this p, though its score does not pass: scores are of the noise as
    /// it is, which may have swallowed it.
    double worth_looking = 0.01;
    /// A step that gains more is placed again [nats]: its place was found by noise that it was itself a part of.
    double placed_again = 50.0;
    /// Candidates of resampling that are fitted first, the likeliest by either kind of errors. The others explain much
    /// the same and take long: they are left out where these come to less than `far` of the leader's merit.
    std::size_t first_sources = 2;
    double far = 0.5;
    /// Contenders beyond Options::most_contenders that samples keep.
    std::size_t more_contenders = 2;
    /// Effects that sets of two or three are grown from.
    std::size_t set_starts = 4;
    /// Residual tests that are fitted as rivals, jumps and rates that follow another column apart.
    std::size_t most_rivals = 4;
    /// Resampling is blurred where interpolated readings are off the straight line by more than this share of their
    /// errors: then the variance swings by less than half, as any other may, and resampling must explain more than
    /// that by a tie.
    double blurred = 0.3;
    /// The course of jumps is searched stretch by stretch and loses a part of what they explain: a random rate must
    /// explain more than jumps by a tie, and by this share of its own merit.
    double lost_of_jumps = 0.1;
    /// Length of a record from which a trend is distinguished from a random rate that does not pass by itself [s]. In
    /// five seconds a random walk shows no more than one slow move.
    double trend_determined_s = 30.0;
    /// Sources of a resampled record are the same within this [of the record's rate].
    double same_source = 1e-3;
    /// Sources faster than this cannot be distinguished from others that make the same pattern [of the record's rate].
    double told_up_to = 2.0;
};

/// Residual tests (samples/residual).
struct SampleResidualOptions {
    /// A line is refined before its test is believed below this p.
    double line_p = 0.01;
    /// Stretches that are compared for a line that does not keep its amplitude.
    std::size_t line_stretches = 20;
    /// Patterns of the place in the record are looked for modulo 2 up to this.
    std::size_t most_modulo = 16;
    /// Fewest rows with one remainder for their mean and size to be compared.
    double fewest_in_pattern = 20.0;
    /// Values in steps that are larger than this share of the standard deviation are not normal, and sums of them are
    /// tested in their place.
    double coarse_lattice = 0.2;
    /// Equal values at the end of their range that may be there without being cut off.
    int most_ties = 4;
    /// Stretches of the record count as disturbed where their variance is more than this times the usual one,
    double disturbed_variance = 2.0;
    /// as improbable as this,
    double disturbed_p = 1e-6;
    /// with so many rows that tell something at least, and the record over this.
    std::size_t disturbed_rows = 50;
    std::size_t disturbed_parts = 500;
    /// Price of a rate of two states: its step and two probabilities [nats].
    double price_of_states = 3.0;
    /// Price of the exact place of each jump, which does not wait for the end of a stretch [nats].
    double price_of_jump = 2.0;
    /// Stretches of the record that may have one of two levels.
    std::size_t level_stretches = 120;
    /// Jumps are placed to one part in so many of a stretch.
    std::size_t jump_places = 50;
    /// Polynomials of time up to this degree.
    std::size_t polynomial_degrees = 6;
    /// Places of a step of the rate.
    std::size_t step_places = 40;
    /// Slow swings: so many, each a quarter of a period over the record more than the one before.
    std::size_t slow_swings = 32;
    /// Time constants of a rate that settles: so many, from the length of the record down, each shorter by this factor.
    std::size_t settling_constants = 14;
    double settling_factor = 1.4;
    /// Lags by which a rate may follow the temperature, reaches over which the input's slope and noise are taken, and
    /// lags by which a rate may follow an acceleration.
    std::size_t temperature_lags = 7;
    std::size_t input_reaches = 5;
    std::size_t acceleration_lags = 4;
};

/// Readings in coarse steps (samples/rounded).
struct SampleRoundedOptions {
    /// Rounding shows the angle where its first harmonic keeps more than this (Widrow and Kollar, "Quantization Noise",
    /// 2008, chapter 5).
    double rounding_shows = 0.01;
    /// Effort: filters whose mixture gives the likelihood of rounded increments: this many for each standard deviation
    /// in a step, doubled up from the fewest to the most. A filter's number has one byte: 256 are the most possible.
    double filters_per_step = 8.0;
    std::size_t fewest_filters = 64;
    std::size_t most_filters = 256;
    /// Least white noise of the angle that the model begins with, when the variance of steps has been taken off
    /// [steps].
    double least_angle_noise = 0.02;
    /// Effort at the start: the likeliest noises are found on the first part of the record [rows] by at most
    /// `climbs_at_start` steps; then the model is fitted again in rounds, each after some draws of the increments.
    std::size_t first_look = 6000;
    int climbs_at_start = 12;
    int rounds_at_start = 2;
    int draws_a_round = 2;
    /// Effort: steps towards the likeliest model before increments are drawn by it, from a model without the random
    /// walk that is added, and before figures are reported.
    int climbs = 2;
    int climbs_with_walk = 6;
    int climbs_of_figures = 4;
    /// Draws that reported figures and their standard errors are the mean of: what rounding hides is the scatter
    /// between draws, which eight give to a quarter.
    int draws_of_figures = 8;
    /// Stretches of the record whose means are compared.
    std::size_t stretches = 16;
    /// Means of stretches move more than white noise lets them where their variance is larger by this factor: with 15
    /// degrees of freedom one time in a thousand.
    double wanders = 2.5;
    /// Increments are drawn beside a random walk that the model lacks where that is likelier by more [nats].
    double drawn_beside_walk = 12.0;
    /// Beside very large steps few of the filters hit the moments at which the angle crosses one: the variance that
    /// they predict may be off by this share of it.
    double filters_off = 0.1;
};

/// The loop (samples/loop).
struct SampleLoopOptions {
    /// Where a larger share of the record is disturbed, that is what the record is like, and nothing is left out.
    double most_disturbed = 0.6;
    /// How often the loop begins again, as an effect that has come in explains what seemed disturbed.
    int most_looks = 3;
    /// It begins again where at least this share of the disturbed rows is explained.
    double restored = 0.05;
    /// A narrow motion remembers for so many times the witness's lags what the witness left untold at the start: these
    /// rows count for nothing, up to one part in `edge_parts` of the record at either end.
    std::size_t remembered_lags = 4;
    std::size_t edge_parts = 20;
    /// Steps of values that add less than this share to the variance change nothing, and are not named.
    double negligible_steps = 1e-3;
    /// A lattice is coarser than the printed digits where its step is larger by this factor.
    double coarser_than_printed = 1.5;
    /// How often a motion is fitted again after each effect that is added.
    int most_motions = 6;
    /// Draws of rounded increments after each effect that is added.
    int draws = 2;
    /// Residual tests that are fitted to say what the record has beyond the model.
    std::size_t most_views = 4;
    /// Placeholders that are added for structure which the library does not have, so that other effects can be found
    /// beside it.
    int most_placeholders = 3;
    /// A line is not reported where its changes, or another line beside it, have more than this share of its power.
    double unsteady_line = 0.02;
    /// Length of a record from which a motion of the case is distinguished from a line and from a random rate [s]: some
    /// twenty correlation times of a resonance that is half a hertz wide.
    double motion_determined_s = 30.0;
};

/// Numbers that decide what is named on a record of samples.
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
