#include "analysis/closure/turns/screen/score_tests.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
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

/// What the effect with these values adds to the phases, over `per`.
Regressor added(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect, const Values& values,
                double per = 1.0) {
    if (effect.adds_angle()) {
        std::vector<double> series = fit.model().added_rad(without, effect, values);
        for (double& value : series) value /= per;
        return series;
    }
    TurnParameters p = fit.parameters();
    p.effects.push_back({&effect, values});
    return difference(fit.model().predict(p), without, per);
}

/// Step of a size by which the phases' change is taken: small against the bounds, large against rounding.
double step_of(const Parameter& size) { return 1e-3 * std::min(1.0, size.max); }

/// Sizes, each by itself or with the phase after it as two amplitudes.
std::optional<Candidate> sizes(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect,
                               Values values) {
    std::vector<Regressor> columns;
    struct Entry {
        const Parameter* size;
        const Parameter* phase;
    };
    std::vector<Entry> entries;
    const auto parameters = effect.parameters();
    for (std::size_t k = 0; k < parameters.size(); ++k) {
        if (parameters[k].role != Role::size) continue;
        const Parameter& size = parameters[k];
        const bool turned = k + 1 < parameters.size() && parameters[k + 1].role == Role::phase;
        entries.push_back({&size, turned ? &parameters[k + 1] : nullptr});
        const double step = step_of(size);
        for (int part = 0; part < (turned ? 2 : 1); ++part) {
            Values at = values;
            at.at(name_of(size)) = step;
            if (turned) at.at(name_of(parameters[k + 1])) = part == 0 ? 0.0 : 0.5 * units::pi;
            columns.push_back(added(fit, without, effect, at, step));
        }
    }
    if (entries.empty()) return std::nullopt;
    for (const auto& column : columns) {
        // Nothing of it is left beside what the model has: this record cannot tell.
        const double all =
            Eigen::Map<const Eigen::VectorXd>(column.series.data(), static_cast<Eigen::Index>(column.series.size()))
                .norm();
        if (all == 0.0) return std::nullopt;
    }
    const TurnFit::Score score = fit.score(columns);
    if (score.rank < static_cast<int>(columns.size())) return std::nullopt;
    Candidate candidate{&effect, std::move(values), score.chi2, chi2_tail(score.chi2, score.rank), 1.0};
    Eigen::Index k = 0;
    for (const Entry& entry : entries) {
        double size = score.value(k++);
        if (entry.phase != nullptr) {
            const double other = score.value(k++);
            candidate.values.at(name_of(*entry.phase)) = std::atan2(other, size);
            size = std::hypot(size, other);
        }
        candidate.values.at(name_of(*entry.size)) = std::clamp(size, 0.98 * entry.size->min, 0.98 * entry.size->max);
    }
    return candidate;
}

/// The phase of the base coupling itself.
std::optional<Candidate> coupling_phase(const TurnFit& fit, const Effect& effect, Values values) {
    // A quarter turn on from a coupling that can be seen, whatever the fit has found without it.
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

std::optional<Candidate> at_some_time(const TurnFit& fit, const TurnModel::Prediction& without, const Effect& effect,
                                      Values values) {
    const Parameter& size = *first_of(effect, Role::size);
    const Parameter& time = *first_of(effect, Role::time);
    const double end = fit.model().series().time_s.back();
    constexpr int places = options.turns.score_tests.times;
    constexpr int finer = options.turns.score_tests.refined_times;
    const auto score_at = [&](double t, double& value) {
        Values at = values;
        at.at(name_of(size)) = 1.0;
        at.at(name_of(time)) = t;
        const auto score = fit.score({added(fit, without, effect, at)});
        if (score.rank < 1) return 0.0;
        value = score.value(0);
        return value / std::sqrt(score.covariance(0, 0));
    };
    double best = 0.0;
    Candidate candidate{&effect, values};
    const auto consider = [&](const std::vector<double>& times) {
        std::vector<double> roots(times.size());
        std::vector<double> sizes(times.size());
        oneapi::tbb::parallel_for(std::size_t{0}, times.size(),
                                  [&](std::size_t k) { roots[k] = score_at(times[k], sizes[k]); });
        for (std::size_t k = 0; k < times.size(); ++k) {
            if (std::abs(roots[k]) <= best) continue;
            best = std::abs(roots[k]);
            candidate.values.at(name_of(time)) = times[k];
            candidate.values.at(name_of(size)) = sizes[k];
        }
        return roots;
    };
    std::vector<double> times;
    for (int k = 1; k < places; ++k) times.push_back(end * k / places);
    const std::vector<double> roots = consider(times);
    const double centre = candidate.values.at(name_of(time));
    times.clear();
    for (int k = 1 - finer; k < finer; ++k) {
        if (k != 0) times.push_back(centre + end / places * k / finer);
    }
    consider(times);
    candidate.chi2 = best * best;
    candidate.p_value = davies_bound(candidate.chi2, roots);
    candidate.searched = davies_places(candidate.chi2, roots);
    return candidate;
}

/// Frequencies of a rate that would show at this one too, or there alone: the lock-in's kicks follow the phase, whose
/// beat with a vibration is a rate that stands in the record as if it were one of its own.
std::array<double, 4> seen_by_beat(const TurnModel& model, double hz) {
    const double beat_hz = model.beat_hz();
    const double dither_hz = 0.5 / model.series().interval_s;
    const auto folded = [&](double f) { return std::abs(std::remainder(f, 2.0 * dither_hz)); };
    return {folded(hz + beat_hz), folded(hz - beat_hz), folded(hz + dither_hz + beat_hz),
            folded(hz + dither_hz - beat_hz)};
}

/// Of that frequency, size and phase free. None where the record cannot tell both amplitudes.
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

/// Slower than three periods in the record is drift; next to half the turns' rate it is the dither's amplitude.
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
    // What else the model could do of a line the spectrum does not know: the highest peaks are looked at closely.
    const TurnOptions::ScoreTests& of = options.turns.score_tests;
    std::vector<std::size_t> peaks;
    for (std::size_t k = 1; k < padded / 2; ++k) {
        if (!band.has(static_cast<double>(k) * bin_hz)) continue;
        if (std::norm(out[k]) >= std::norm(out[k - 1]) && std::norm(out[k]) > std::norm(out[k + 1])) peaks.push_back(k);
    }
    std::sort(peaks.begin(), peaks.end(),
              [&](std::size_t a, std::size_t b) { return std::norm(out[a]) > std::norm(out[b]); });
    if (peaks.size() > of.peaks) peaks.resize(of.peaks);
    std::vector<double> places;
    for (std::size_t k = 0; k < peaks.size(); ++k) {
        places.push_back(static_cast<double>(peaks[k]) * bin_hz);
        if (k >= of.peaks_with_images) continue;
        for (const double hz : seen_by_beat(fit.model(), places.back())) {
            if (band.has(hz)) places.push_back(hz);
        }
    }
    if (places.empty()) return std::nullopt;
    Candidate best{&effect, values_at_rest(effect)};
    for (const double hz : places) keep_better(best, at_frequency(fit, without, effect, hz));
    const double centre = best.values.at(name_of(*first_of(effect, Role::frequency)));
    for (const double off : {-1.0, -0.5, 0.5, 1.0}) {
        keep_better(best, at_frequency(fit, without, effect, centre + off * bin_hz));
    }
    best.searched = places_of_frequency(best.chi2, 0.5 * static_cast<double>(n));
    best.p_value = of_several(chi2_tail(best.chi2, 2), best.searched);
    return best;
}

std::optional<Candidate> spread(const TurnFit& fit, const Effect& effect, Values values) {
    const Parameter& deviation = *first_of(effect, Role::deviation);
    const TurnFit::Spread found = fit.spread({&effect, values}, name_of(deviation), deviation.max);
    values.at(name_of(deviation)) = found.deviation;
    // A variance cannot be negative: half of the time there is no gain at all (Chernoff 1954).
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

std::vector<Candidate> screen(const TurnFit& fit) {
    const TurnModel::Prediction without = fit.model().predict(fit.parameters());
    const auto registry = effects::registry();
    std::vector<std::optional<Candidate>> found(registry.size());
    oneapi::tbb::parallel_for(std::size_t{0}, registry.size(), [&](std::size_t k) {
        const Effect* effect = registry[k];
        TurnParameters p = fit.parameters();
        if (p.find(effect->name()) != nullptr || told_by_other_columns(*effect)) return;
        const Values rest = values_at_rest(*effect);
        try {
            if (first_of(*effect, Role::frequency) != nullptr) {
                if (effect->adds_angle()) found[k] = at_some_frequency(fit, without, *effect);
            } else if (first_of(*effect, Role::time) != nullptr) {
                if (effect->adds_angle()) found[k] = at_some_time(fit, without, *effect, rest);
            } else if (first_of(*effect, Role::deviation) != nullptr) {
                found[k] = spread(fit, *effect, rest);
            } else if (first_of(*effect, Role::size) != nullptr) {
                found[k] = sizes(fit, without, *effect, rest);
            } else if (first_of(*effect, Role::phase) != nullptr) {
                found[k] = coupling_phase(fit, *effect, rest);
            }
        } catch (const RunError&) {
            // no motion of a gyro with a little of it can be followed
        }
    });
    std::vector<Candidate> candidates;
    for (auto& candidate : found) {
        if (candidate) candidates.push_back(std::move(*candidate));
    }
    return candidates;
}

}  // namespace ringlock::closure
