#include "analysis/closure/turns/screen/score_tests.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using effects::Effect;
using effects::first_of;
using effects::Parameter;
using effects::Role;
using effects::Values;

std::string name_of(const Parameter& parameter) { return std::string(parameter.name); }

/// The phases that the effect adds at these values, over `per`.
Regressor added(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect, const Values& values,
                double per = 1.0) {
    if (changes_angle_only(effect)) {
        std::vector<double> series = fit.model().added_rad(without, effect, values);
        for (double& value : series) value /= per;
        return series;
    }
    TurnParameters p = fit.parameters();
    p.effects.push_back({&effect, values});
    return difference(fit.model().predict(p), without, per);
}

/// Step of a size for the derivative of the phases: small against the bounds, large against rounding.
double step_of(const Parameter& size) { return 1e-3 * std::min(1.0, size.max); }

/// One column for each amplitude of the effect, two if the size has a phase, with all other parameters at these values.
/// \param unit_steps  for an effect whose phases are proportional to its sizes
std::vector<Regressor> columns_of(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect,
                                  const std::vector<Amplitude>& amplitudes, const Values& values, bool unit_steps) {
    std::vector<Regressor> columns;
    for (const Amplitude& amplitude : amplitudes) {
        const double step = unit_steps ? 1.0 : step_of(*amplitude.value);
        for (int part = 0; part < (amplitude.turned_by != nullptr ? 2 : 1); ++part) {
            Values at = values;
            at.at(name_of(*amplitude.value)) = step;
            if (amplitude.turned_by != nullptr) {
                at.at(name_of(*amplitude.turned_by)) = part == 0 ? 0.0 : 0.5 * units::pi;
            }
            columns.push_back(added(fit, without, effect, at, step));
        }
    }
    return columns;
}

/// Sets the amplitudes by the regression on these columns, within their bounds.
void set_amplitudes(const std::vector<Amplitude>& amplitudes, const Eigen::VectorXd& found, Values& values) {
    Eigen::Index k = 0;
    for (const Amplitude& amplitude : amplitudes) {
        double value = found(k++);
        if (amplitude.turned_by != nullptr) {
            const double other = found(k++);
            values.at(name_of(*amplitude.turned_by)) = std::atan2(other, value);
            value = std::hypot(value, other);
        }
        const Parameter& of = *amplitude.value;
        values.at(name_of(of)) = std::clamp(value, 0.98 * of.min, 0.98 * of.max);
    }
}

/// All amplitudes of an effect that acts all the time.
std::optional<Candidate> sizes(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect,
                               Values values) {
    const std::vector<Amplitude> amplitudes = amplitudes_of(effect);
    const std::vector<Regressor> columns = columns_of(fit, without, effect, amplitudes, values, false);
    for (const auto& column : columns) {
        // The model already contains such a column, so the record does not determine the effect.
        const double all =
            Eigen::Map<const Eigen::VectorXd>(column.series.data(), static_cast<Eigen::Index>(column.series.size()))
                .norm();
        if (all == 0.0) return std::nullopt;
    }
    const TurnFit::Score score = fit.score(columns);
    if (score.rank < static_cast<int>(columns.size())) return std::nullopt;
    Candidate candidate{&effect, std::move(values), score.chi2, chi2_tail(score.chi2, score.rank), 1.0};
    set_amplitudes(amplitudes, score.value, candidate.values);
    return candidate;
}

/// The phase of the base coupling itself.
std::optional<Candidate> coupling_phase(const TurnFit& fit, const Effect& effect, Values values) {
    // The change from no coupling to one whose phase is a quarter turn further and whose size is visible, whatever
    // threshold the fit has.
    const std::string name = name_of(effect.parameters().front());
    TurnParameters p = fit.parameters();
    const double found = p.threshold_deg_h;
    p.threshold_deg_h = std::max(found, fit.model().series().setup.lockin_threshold_deg_h);
    values.at(name) = 0.5 * units::pi;
    p.effects.push_back({&effect, values});
    TurnParameters bare = fit.parameters();
    bare.threshold_deg_h = 0.0;
    const TurnFit::Score score = fit.score({difference(fit.model().predict(p), fit.model().predict(bare), 1.0)});
    if (score.rank < 1) return std::nullopt;
    Candidate candidate{&effect, values, score.chi2, chi2_tail(score.chi2, 1), 1.0};
    candidate.values.at(name) = std::atan2(score.value(0) * p.threshold_deg_h, found);
    return candidate;
}

/// All amplitudes of an effect that begins at a time, which is searched.
std::optional<Candidate> at_some_time(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect,
                                      Values values) {
    const std::vector<Amplitude> amplitudes = amplitudes_of(effect);
    if (amplitudes.empty()) return std::nullopt;
    const std::string time = name_of(*first_of(effect, Role::time));
    const double end = fit.model().series().time_s.back();
    constexpr int positions = options.turns.score_tests.times;
    constexpr int finer = options.turns.score_tests.refined_times;
    /// Root of the chi-squared of all amplitudes together, with the sign of a single one; zero if the record does not
    /// distinguish them from each other or from the model.
    struct Place {
        double root = 0.0;
        Eigen::VectorXd value = {};
        int rank = 0;
    };
    const auto place_at = [&](double t) {
        Values at = values;
        at.at(time) = t;
        const auto columns = columns_of(fit, without, effect, amplitudes, at, changes_angle_only(effect));
        const auto score = fit.score(columns);
        if (score.rank < static_cast<int>(columns.size())) return Place{};
        const double root =
            score.rank == 1 ? score.value(0) / std::sqrt(score.covariance(0, 0)) : std::sqrt(std::max(score.chi2, 0.0));
        return Place{root, score.value, score.rank};
    };
    double best = 0.0;
    int freedom = 1;
    Candidate candidate{&effect, values};
    const auto consider = [&](const std::vector<double>& times) {
        std::vector<Place> found(times.size());
        side_by_side(times.size(), [&](std::size_t k) { found[k] = place_at(times[k]); });
        std::vector<double> roots;
        for (std::size_t k = 0; k < times.size(); ++k) {
            roots.push_back(found[k].root);
            if (std::abs(found[k].root) <= best) continue;
            best = std::abs(found[k].root);
            freedom = found[k].rank;
            candidate.values.at(time) = times[k];
            set_amplitudes(amplitudes, found[k].value, candidate.values);
        }
        return roots;
    };
    std::vector<double> times;
    for (int k = 1; k < positions; ++k) times.push_back(end * k / positions);
    const std::vector<double> roots = consider(times);
    const double centre = candidate.values.at(time);
    times.clear();
    for (int k = 1 - finer; k < finer; ++k) {
        if (k != 0) times.push_back(centre + end / positions * k / finer);
    }
    consider(times);
    candidate.chi2 = best * best;
    candidate.p_value = davies_bound(candidate.chi2, roots, freedom);
    candidate.look_elsewhere = davies_look_elsewhere(candidate.chi2, roots);
    return candidate;
}

/// Frequencies of a rate that would also show at this one, or only there. The kicks of the lock-in follow the phase,
/// and their beat with a vibration is a rate that appears in the record like any other.
std::array<double, 4> seen_by_beat(const TurnModel& model, double hz) {
    const double beat_hz = model.beat_hz();
    const double dither_hz = 0.5 / model.series().interval_s;
    const auto folded = [&](double f) { return std::abs(std::remainder(f, 2.0 * dither_hz)); };
    return {folded(hz + beat_hz), folded(hz - beat_hz), folded(hz + dither_hz + beat_hz),
            folded(hz + dither_hz - beat_hz)};
}

/// A line of that frequency with free size and phase; none if the record does not determine both amplitudes.
std::optional<Candidate> at_frequency(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect,
                                      double hz) {
    const std::string size = name_of(*first_of(effect, Role::size));
    const std::string phase = name_of(*first_of(effect, Role::phase));
    Values values = values_at_rest(effect);
    values.at(size) = 1.0;
    values.at(name_of(*first_of(effect, Role::frequency))) = hz;
    std::vector<Regressor> columns;
    for (const double turned : {0.0, 0.5 * units::pi}) {
        values.at(phase) = turned;
        columns.push_back(added(fit, without, effect, values));
    }
    const auto score = fit.score(columns);
    if (score.rank < 2) return std::nullopt;
    values.at(size) = std::hypot(score.value(0), score.value(1));
    values.at(phase) = std::atan2(score.value(1), score.value(0));
    return Candidate{&effect, std::move(values), score.chi2};
}

void keep_better(Candidate& best, std::optional<Candidate> other) {
    if (other && other->chi2 > best.chi2) best = std::move(*other);
}

/// Frequencies that a rate may have.
struct Band {
    double lowest_hz, highest_hz;
    bool has(double hz) const { return hz >= lowest_hz && hz < highest_hz; }
};

/// A line with fewer periods in the record is drift, and one next to half the rate of turns is the dither's amplitude.
Band band_of(const TurnSeries& series) {
    return {options.turns.reading.fewest_periods / (static_cast<double>(series.size()) * series.interval_s),
            0.5 / series.interval_s - series.amplitude_band_hz()};
}

std::optional<Candidate> at_some_frequency(const TurnFit& fit, const TurnModel::Prediction& without,
                                           const Effect& effect) {
    const TurnSeries& series = fit.model().series();
    const Band band = band_of(series);
    const Eigen::VectorXd residual = fit.residual();
    const std::size_t n = fit.rows().size();
    std::size_t padded = 1;
    while (padded < 4 * n) padded *= 2;
    std::vector<double> in(padded, 0.0);
    for (std::size_t i = 0; i < n; ++i) in[i] = residual(static_cast<Eigen::Index>(i));
    std::vector<std::complex<double>> out;
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
    fft.fwd(out, in);
    const double bin_hz = 1.0 / (static_cast<double>(padded) * series.interval_s);
    // The model's own parameters can follow a part of a line, which the spectrum does not include, so each of the
    // highest peaks is tested.
    const TurnOptions::ScoreTests& of = options.turns.score_tests;
    std::vector<std::size_t> peaks;
    for (std::size_t k = 1; k < padded / 2; ++k) {
        if (!band.has(static_cast<double>(k) * bin_hz)) continue;
        if (std::norm(out[k]) >= std::norm(out[k - 1]) && std::norm(out[k]) > std::norm(out[k + 1])) peaks.push_back(k);
    }
    std::sort(peaks.begin(), peaks.end(),
              [&](std::size_t a, std::size_t b) { return std::norm(out[a]) > std::norm(out[b]); });
    if (peaks.size() > of.peaks) peaks.resize(of.peaks);
    std::vector<double> frequencies_hz;
    for (std::size_t k = 0; k < peaks.size(); ++k) {
        frequencies_hz.push_back(static_cast<double>(peaks[k]) * bin_hz);
        if (k >= of.peaks_with_images) continue;
        for (const double hz : seen_by_beat(fit.model(), frequencies_hz.back())) {
            if (band.has(hz)) frequencies_hz.push_back(hz);
        }
    }
    if (frequencies_hz.empty()) return std::nullopt;
    Candidate best{&effect, values_at_rest(effect)};
    for (const double hz : frequencies_hz) keep_better(best, at_frequency(fit, without, effect, hz));
    const double centre = best.values.at(name_of(*first_of(effect, Role::frequency)));
    for (const double off : {-1.0, -0.5, 0.5, 1.0}) {
        keep_better(best, at_frequency(fit, without, effect, centre + off * bin_hz));
    }
    best.look_elsewhere = look_elsewhere_of_frequency(best.chi2, 0.5 * static_cast<double>(n));
    best.p_value = of_several(chi2_tail(best.chi2, 2), best.look_elsewhere);
    return best;
}

std::optional<Candidate> spread(const TurnFit& fit, const Effect& effect, Values values) {
    const Parameter& deviation = *first_of(effect, Role::deviation);
    const TurnFit::Spread found = fit.spread({&effect, values}, name_of(deviation), deviation.max);
    values.at(name_of(deviation)) = found.deviation;
    // A variance cannot be negative: in half of the cases there is no gain (Chernoff 1954).
    return Candidate{&effect, std::move(values), found.chi2, 0.5 * chi2_tail(found.chi2, 1), 1.0};
}

}  // namespace

std::vector<double> frequencies_as_likely(const TurnFit& fit, const Effect& effect, double hz, double chi2_apart) {
    std::vector<double> found;
    const TurnModel::Prediction without = fit.model().predict(fit.parameters());
    const TurnSeries& series = fit.model().series();
    const auto chosen = at_frequency(fit, without, effect, hz);
    if (!chosen) return found;
    const double width_hz = 1.0 / (static_cast<double>(series.size()) * series.interval_s);
    for (const double image : seen_by_beat(fit.model(), hz)) {
        if (!band_of(series).has(image) || std::abs(image - hz) < options.turns.score_tests.line_width * width_hz)
            continue;
        Candidate best{&effect, {}};
        for (const double off : {-0.5, -0.25, 0.0, 0.25, 0.5}) {
            keep_better(best, at_frequency(fit, without, effect, image + off * width_hz));
        }
        if (!best.values.empty() && best.chi2 > chosen->chi2 - chi2_apart) {
            found.push_back(best.values.at(name_of(*first_of(effect, Role::frequency))));
        }
    }
    return found;
}

std::optional<Candidate> score_test(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect) {
    const effects::Changes changes = effect.changes();
    const Values rest = values_at_rest(effect);
    if (first_of(effect, Role::frequency) != nullptr) {
        return changes.angle ? at_some_frequency(fit, without, effect) : std::nullopt;
    }
    if (first_of(effect, Role::time) != nullptr) {
        const bool shows = changes.angle || changes.threshold || changes.coupling_phase;
        return shows ? at_some_time(fit, without, effect, rest) : std::nullopt;
    }
    if (first_of(effect, Role::deviation) != nullptr) return spread(fit, effect, rest);
    if (first_of(effect, Role::size) != nullptr) return sizes(fit, without, effect, rest);
    if (first_of(effect, Role::phase) != nullptr) return coupling_phase(fit, effect, rest);
    return std::nullopt;
}

std::vector<Candidate> screen(const TurnFit& fit) {
    const TurnModel::Prediction without = fit.model().predict(fit.parameters());
    const auto registry = effects::registry();
    std::vector<std::optional<Candidate>> found(registry.size());
    side_by_side(registry.size(), [&](std::size_t k) {
        const Effect* effect = registry[k];
        if (fit.parameters().find(effect) != nullptr || estimated_from_other_columns(*effect)) return;
        try {
            found[k] = score_test(fit, without, *effect);
        } catch (const RunError&) {
            // no motion of a gyro with a small size of the effect can be followed
        }
    });
    std::vector<Candidate> candidates;
    for (auto& candidate : found) {
        if (candidate) candidates.push_back(std::move(*candidate));
    }
    return candidates;
}

}  // namespace ringlock::closure
