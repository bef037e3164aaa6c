#pragma once
#include <cstddef>

namespace ringlock::closure {

/// Numbers that decide which effects are reported for a record of turns, one structure for each directory.
struct TurnOptions {
    /// Reading of a record: count and quadrature joined, and the quantities that a fit needs (turns/model/series).
    struct Reading {
        /// A phase counts as seen at all turns if each twelfth of a fringe holds at least a quarter of an even share,
        /// at minima and at maxima. A locked gyro stays at a few phases, where structure in the phase cannot be
        /// distinguished from structure of the dither.
        std::size_t phase_bins = 12;
        double least_share_of_even = 0.25;

        /// Number of turns whose most frequent difference between count and quadrature is taken for the counter's zero.
        std::size_t turns_for_zero = 64;
        /// A miscount is seen if the phase lies further outside the counted quarter than this margin [quarters]:
        /// edges of the counter may be off by 0.15, and six standard deviations of the phase are added so that noise
        /// makes no miscount. At 0.4 the next quarter would be as near.
        double edge_margin = 0.15;
        double noise_margin_sd = 6.0;
        double most_margin = 0.4;
        /// Largest probability of a miscount per turn with which the chain of miscounts begins [1].
        double most_miscounts_per_turn = 0.5;

        /// Radii further from the median than this are not noise of the detectors [robust standard deviations].
        double radius_outlier_sd = 6.0;

        /// Largest rotation, relative to the dither's peak rate, at which records are closed [1]. The half cycles then
        /// have two thirds of their length and more; nearer to the peak rate the phase hardly reverses.
        double most_rotation = 0.5;
        /// Least mean swing of the phase over a half cycle [rad]: somewhat less than the 62.8 rad of ten fringes, the
        /// fewest that the turn map is made for (docs/dev/turn-map.md).
        double least_swing_rad = 60.0;

        /// Oscillations within this of the dither's frequency belong to its amplitude: relative to that frequency [1],
        /// and at least this number of periods in the record, below which they are drift.
        double amplitude_band = 0.01;
        double fewest_periods = 3.0;
    };
    Reading reading;

    /// Prediction of the phases (turns/model/model).
    struct Model {
        /// Times of the dither's turns are means over this many turns to either side, as a resonator keeps its time far
        /// better than a zero-rate point is known from pulses that the lock-in moves.
        std::ptrdiff_t smoothing_turns = 64;
        /// Kicks are computed at the rates that effects add if these move the zero-rate points by more than this share
        /// of the time within which the phase turns [1], a relative change of the kicks that no record shows.
        double rate_felt_by_kicks = 1e-3;
        /// A Gauss-Markov rate with a longer correlation time than this is bias [durations of the record]: it changes
        /// by a quarter of its standard deviation within the record.
        double longest_correlation = 30.0;
    };
    Model model;

    /// Maximum likelihood (turns/fit).
    struct Fit {
        /// Degree of the polynomial in time that the dither's amplitude follows.
        std::size_t degree_of_amplitude = 4;

        /// Standard deviations of the prior on bias and threshold, relative to the declared threshold [1]. They matter
        /// only for a locked gyro, which shows a combination of both; any other record overrides them.
        double bias_prior = 0.1;
        double threshold_prior = 1.0;

        /// Reading errors are estimated, and the kicks linearised about the estimate, if that changes their mean
        /// variance by more than this share of the readout's [1]. It is small because models that are compared must be
        /// linear about the same phases; otherwise one of them gains by the linearisation alone.
        double reading_errors_matter = 1e-4;

        /// A radius of the quadrature with less noise than this does not determine the noise of the phase [rad].
        double least_radius_sd_rad = 1e-7;
        /// A noise that explains less than this may have absorbed an effect [nats]. It is more than is explained by an
        /// effect that is hard to detect. Score tests are then repeated without the noise.
        double weak_noise = 100.0;
        /// Another start of the noise is maximised if it begins less than this below the present maximum [nats]: the
        /// maxima of one likelihood are near each other.
        double maxima_apart = 20.0;

        /// Effort: passes of Gauss-Newton between two fits of the noise, the same in a fit without weak noise, and
        /// rounds of both together.
        int passes = 4;
        int passes_without_noise = 20;
        int most_rounds = 24;
        /// Rounds continue while they gain more than `gained`, from round `soon` on more than `gained_late` [nats], and
        /// end where `rounds_ahead` more rounds as good as the last would not reach the required log-likelihood.
        int soon = 6;
        double gained = 0.01;
        double gained_late = 10.0;
        double rounds_ahead = 100.0;
        /// Passes in which the density of bounded noise is estimated: the lock-in is not correct before the last of
        /// them.
        int passes_of_shape = 3;

        /// Effort: for a time at which the coupling changes, turns to either side that are tried in its place (more
        /// than the distance between two times of the score test), and most repetitions.
        int turns_about_time = 64;
        int most_time_rounds = 4;

        /// Values of one standard deviation from which a fit starts; the likeliest is taken.
        struct Grid {
            double first, end, factor;
        };
        Grid injected_rad = {1e-4, 1e3, 4.0};
        Grid wander_rad = {1e-7, 1e2, 10.0};
        /// Shares of the injected noise that are tried for a wander whose noise converged to zero [1].
        Grid wander_of_injected = {0.5, 1e-4, 0.25};
        /// Injected noise and wander that are tried in place of each other, relative to the readout's noise [1].
        double other_injected = 0.05;
        double other_wander = 1e-3;
        /// Number of standard deviations of a random effect that are tried, each a tenth of the one before.
        int decades_of_spread = 11;

        /// A column whose part orthogonal to the model's own columns is less than this is one of them except for
        /// rounding [1]: the record does not distinguish it from the model's parameters.
        double least_independent_share = 1e-5;

        /// Most passes of a regression, each with the noise fitted again.
        int most_regression_passes = 8;
    };
    Fit fit;

    /// Score tests of the library (turns/screen/score_tests).
    struct ScoreTests {
        /// Effort: number of times tried over the record; the best is refined to the distance between two over
        /// `refined_times`.
        int times = 80;
        int refined_times = 8;
        /// Effort: highest peaks of the spectrum that are tested; for the first of them also the frequencies whose beat
        /// with the kicks would show there.
        std::size_t peaks = 8;
        std::size_t peaks_with_images = 4;
        /// Frequencies nearer than this are one line [inverse durations of the record].
        double line_width = 2.0;
    };
    ScoreTests score_tests;

    /// Effects that show in columns other than the phase (turns/screen/side_channels).
    struct SideChannels {
        /// The shape of the dither has converged if no parameter moves by more than this [standard errors].
        double same_shape = 0.1;
        /// Probability that noise makes a miscount at one turn [1]: the margin is six standard deviations of the phase
        /// (Reading::noise_margin_sd), two-sided 2e-9, and only one side can be passed.
        double miscount_by_chance = 1e-9;
    };
    SideChannels side_channels;

    /// The dither's shape from times and accelerations at the turns (turns/screen/dither_shape).
    struct DitherShape {
        /// Stretches of the record whose scatter gives standard errors without a noise model; fewest turns in a stretch
        /// for its rate and for its mean, and fewest stretches that have a mean.
        std::size_t stretches = 120;
        std::size_t fewest_turns_for_rate = 8;
        std::size_t fewest_turns_for_mean = 4;
        double fewest_stretches = 8.0;

        /// Accelerations are used if they differ from the dither's by a factor of less than exp(this), and if more than
        /// this share of the turns has one [1].
        double most_log_acceleration = 1.0;
        double least_share = 0.25;
        /// Least standard error of an acceleration's logarithm [1].
        double least_acceleration = 1e-5;
        /// Accelerations by two pulses are too small by this times the mean square of their dependence on the phase, to
        /// second order in the lock-in. Integrated numerically (test
        /// `DitherShape.AccelerationsComeOutTooSmallOfSecondOrder`).
        double second_order = 0.145;
        /// Relative uncertainties of corrections [1]: of the correction of second order, and of the corrections of the
        /// accelerations for pulses and rotation.
        double doubt_of_second_order = 0.5;
        double doubt_of_pulses = 0.1;

        /// Least standard error of the lateness [1]: relative to the interval, the error of the approximations of turn
        /// times (1e-7 of an asymmetry); and the share of the lock-in's shift that clocks do not follow.
        double least_late = 5e-8;
        double doubt_of_followed = 0.02;
        /// Relative uncertainty of the jerk's correction [1], since instruments may compute accelerations from pulses
        /// in other ways.
        double doubt_of_jerk = 0.2;
        /// Uncertainty of the jerk in units of the even part of the accelerations [1]: a third harmonic of the dither
        /// changes the jerk by 24 times itself and the even part by 9 times.
        double doubt_by_harmonic = 10.0;

        /// Accelerations that differ from the dither's by more than this [1] and by more than this number of standard
        /// errors are noted. A note needs no level, but must not appear by chance.
        double noted = 0.002;
        double noted_sd = 10.0;
    };
    DitherShape dither_shape;

    /// The dither's amplitude (turns/screen/dither_amplitude).
    struct DitherAmplitude {
        /// Most oscillations of the amplitude in the model.
        std::size_t most_swings = 6;
        /// Effort: highest peaks of the spectrum that are tested.
        std::size_t peaks = 4;
        /// Independent frequencies in the band, relative to the Fourier frequencies: half as many again, since maxima
        /// also lie between these (Quinn and Hannan, The Estimation and Tracking of Frequency, 2001, section 3).
        double trials_per_bin = 1.5;
        /// Cost of an oscillation in addition to its amplitudes and the search [nats]: its frequency, fitted between
        /// two independent ones.
        double cost_of_frequency = 1.0;
        /// P-value of correlated innovations below which a wander that decays is fitted; it then has to pass the level
        /// of an effect.
        double memory_worth_fitting = 1e-3;
        /// Values of interval over correlation time from which that fit starts [1], and the share of the injected noise
        /// that may belong to the wander that decays.
        double forgets[3] = {0.3, 0.03, 0.003};
        double share_of_injected = 0.5;
    };
    DitherAmplitude dither_amplitude;

    /// The rate of missed pulses (turns/screen/miscounts).
    struct Miscounts {
        /// Effort: most passes of the algorithm of Baum et al.
        int most_passes = 100;
    };
    Miscounts miscounts;

    /// Tests of the residual (turns/residual).
    struct Residual {
        /// Harmonics of the phase at which kicks and readings are tested. The library has two; six leave room for
        /// effects that it does not have.
        int harmonics = 6;
        /// Largest amplitude of a kick that is an alternative [rad], that of harmonic k over k. With larger kicks the
        /// phase is no longer determined by the phase without them, and any noise could be explained.
        double largest_kick_rad = 0.3;
        /// Number of kicks that change in time: half a period in the record, one, and so on.
        std::size_t kick_periods = 40;
        /// The dither's amplitude is followed by a filter whose gain is estimated from differences over this lag
        /// [turns] and over twice the lag. Growth of less than `no_growth_sd` standard errors counts as zero, and the
        /// gain is kept between `least_gain` and `most_gain`.
        std::size_t amplitude_lag = 8;
        double no_growth_sd = 4.0;
        double least_gain = 1.0 / 200.0;
        double most_gain = 0.5;
        /// Degree of the polynomial in time on which rates are regressed.
        int degree_of_rates = 6;
        /// Number of times at which a step of the rate is tested.
        int steps = 80;
        /// Number of drifts of a line that are tested, odd, and the distance between two [periods over the record]: at
        /// half of that distance a line has lost a tenth of its power.
        int drifts = 81;
        double drifts_apart = 3.0;
        /// Lowest bin of the padded spectrum that can be a line: two periods in the record. Slower is drift.
        std::size_t lowest_bin = 4;
        /// Independent frequencies per Fourier frequency (Quinn and Hannan 2001, section 3).
        double trials_per_bin = 1.5;
        /// Sums of fewer innovations than this may be flatter than normal ones: bounded noise is no structure, and
        /// longer sums are normal enough.
        std::size_t bounded_sums = 16;
        /// Stretches of the record in which the size of the residual is compared, and fewest training rows of each.
        std::size_t stretches_of_size = 20;
        double fewest_rows_of_size = 8.0;
        /// Directions of size over phase with less than this share of the largest variance are excluded [1]: only the
        /// first turns of a locked gyro have them.
        double least_direction = 1e-3;
    };
    Residual residual;

    /// A rate that jumps between two levels (turns/residual/jumps).
    struct Jumps {
        /// Stretches of the record in which jumps are searched, and the factor to finer ones under the noise of the
        /// jumps.
        std::size_t stretches = 120;
        std::size_t finer = 3;
        /// Cost of the exact place of each jump within its stretch [nats].
        double cost_of_place = 2.0;
        /// Jumps are fitted with their own noise if their evidence reaches this share of that of the competing effects
        /// [1]. Of a true random rate they explain far less, and there are many.
        double near_competing = 0.9;
        /// Effort: searches under the noise that the jumps leave, passes that move all jumps together, and single stays
        /// whose removal is tried.
        int most_searches = 4;
        int most_moves = 12;
        std::size_t most_single_stays = 8;
        /// Moves end at gains below this [nats], or below this share of the evidence, since large values of the
        /// evidence are compared only that precisely.
        double gained = 0.1;
        double gained_of_evidence = 1e-4;
        /// Times are first found to this part of a stretch, and a joint move is shortened to this part of itself [1].
        double place_precision = 0.02;
        double least_share_of_move = 0.1;
    };
    Jumps jumps;

    /// The selection of effects (turns/loop).
    struct Loop {
        /// Held-out error below which the residual is the rounding of sums of as many numbers as turns, here and in the
        /// program that made the record [rad].
        double rounding_rad = 1e-6;
        /// Injected noise at the turns that makes all phases independent [rad]: with less noise phases come in step,
        /// and everything that follows the phase makes lines.
        double randomising_noise_rad = 1.0;
        /// Factor by which kicks in a residual test count for more than a line on the beat of the phases: their
        /// evidence is of first order only.
        double phase_against_beat = 2.0;
        /// Relative error of the evidence of a residual test, since its kicks are of first order only.
        double first_order_error = 0.02;
        /// A random rate follows a cause that is visible in a noisy column better than the column does, by up to this
        /// share of its evidence.
        double noise_of_column = 0.1;
        /// Residual tests that are refitted with the noise, those of largest evidence first.
        std::size_t tests_refitted = 4;

        /// Largest p-value of a score test that is worth a full fit: scores use the fitted noise, which may have
        /// absorbed most of an effect.
        double worth_a_fit_p = 0.1;
        /// Chi-squared of a rate that is strong enough to have biased the other parameters.
        double strong_chi2 = 400.0;
        /// Share of an effect's estimate from which the first fit starts, where coupling, threshold and bias move
        /// together.
        double small_share = 0.01;
        /// A fit should gain half of the score's chi-squared. One that gains less than this share of it may lie at
        /// another maximum of the likelihood.
        double nearly_all_of_chi2 = 0.45;
        /// The same for a strong rate; below it the rate is also fitted from the start of the model.
        double little_of_chi2 = 0.25;
        /// Number of starts with ever smaller shares of the estimate, where the fit gains nothing.
        int shorter_starts = 4;
        /// Candidates of at least this share of the largest evidence are also fitted from the start of the model.
        double nearly_best = 0.9;
        /// Evidence above which fits that stay far below it are not completed [nats], and the share of it that they
        /// must reach.
        double much_evidence = 200.0;
        double far_below = 0.5;

        /// Candidates that are tried as first and second member of a pair, and as third member of a triple.
        std::size_t first_of_pair = 3;
        std::size_t second_of_pair = 2;
        std::size_t third_of_triple = 2;
        /// Share of the largest evidence that a pair without a random rate must have for a third effect to be tried.
        double most_of_evidence = 0.75;
        /// Second effects that are tried next to one of the coupling.
        std::size_t second_of_coupling = 3;

        /// Evaluations of the dither's shape after an effect was added; they converge within three.
        int shape_readings = 3;
        /// Rounds of the loop for each step that it may end with.
        std::size_t rounds_per_step = 3;

        /// Stretches of the record over which the dither's frequency is averaged for the report, and the lag
        /// [stretches] at which the weights of their correlation in its standard error have fallen to zero: a quarter
        /// of the record, since a varying input is correlated for long.
        std::size_t frequency_stretches = 40;
        std::size_t frequency_memory = 10;
    };
    Loop loop;

    /// Memory of the fits (turns/model/side_by_side). The results do not depend on it.
    struct Effort {
        /// Threads that work on a record in parallel hold up to half a kilobyte a turn each. All of them together may
        /// process this number of turns (0.5 GB); `fewest_threads` are always allowed.
        double turns_of_all_threads = 1e6;
        int fewest_threads = 2;
    };
    Effort effort;
};

}  // namespace ringlock::closure
