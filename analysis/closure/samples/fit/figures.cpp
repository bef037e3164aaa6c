#include "analysis/closure/samples/fit/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

using effects::Role;

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// Time of the middle of the record, on its clock.
double middle_of(const SampleSeries& series) {
    return series.time_s[0] - 0.5 * series.interval_s +
           0.5 * static_cast<double>(series.size() - 1) * series.interval_s;
}

/// Frequency of a declared dither, or of its harmonic, whose alias is this line; without one, the frequency of the
/// line.
struct Unaliased {
    double hz;
    double drift_sign = 1.0;
    double from_hz_times = 0.0;  ///< multiple of the source's rate in it
};
Unaliased unaliased(double hz, const SampleFit& fit, const record::Declared& declared) {
    if (!declared.dither_frequency_hz) return {hz};
    const double from_hz = fit.model().noise.from_hz;
    constexpr auto harmonic_count = static_cast<int>(options.samples.screen.harmonic_shares.size());
    for (int h = 1; h <= harmonic_count; ++h) {
        const double of_dither = h * *declared.dither_frequency_hz;
        const Alias shown = alias(of_dither, from_hz > 0.0 ? from_hz : fit.series().rate_hz);
        if (std::abs(shown.hz - hz) >= options.samples.declared_dither_error * of_dither) continue;
        const double sign = shown.folded ? -1.0 : 1.0;
        return {of_dither + sign * (hz - shown.hz), sign, from_hz > 0.0 ? std::round(of_dither / from_hz) : 0.0};
    }
    return {hz};
}

/// Lines at other frequencies leave the same readings. Frequencies of typical dithers are listed first, harmonics of
/// the declared one before all.
/// \param amplitude  text of the amplitude of the line at a frequency
std::string note_on_aliases(const Unaliased& line, const SampleFit& fit, const record::Declared& declared,
                            const effects::Effect& effect, const std::function<std::string(double hz)>& amplitude) {
    const double from_hz = fit.model().noise.from_hz;
    const double readings_hz = from_hz > 0.0 ? from_hz : fit.series().rate_hz;
    const double shown_hz = alias(line.hz, readings_hz).hz;
    struct Other {
        double hz;
        int rank;
    };
    std::vector<Other> others;
    const auto add = [&](double hz) {
        if (!(hz > 0.0) || std::abs(hz - line.hz) < options.samples.fit.same_alias * readings_hz) return;
        int rank = hz >= options.samples.fit.slowest_dither_hz && hz <= options.samples.fit.fastest_dither_hz ? 1 : 2;
        if (declared.dither_frequency_hz) {
            const double ratio = hz / *declared.dither_frequency_hz;
            const double order = std::round(ratio);
            if (std::abs(ratio - order) < options.samples.declared_dither_error * order) rank = 0;
        }
        others.push_back({hz, rank});
    };
    for (int k = 0; k * readings_hz <= options.samples.fit.fastest_dither_hz + readings_hz; ++k) {
        add(k * readings_hz - shown_hz);
        add(k * readings_hz + shown_hz);
    }
    std::sort(others.begin(), others.end(),
              [](const Other& a, const Other& b) { return std::pair(a.rank, a.hz) < std::pair(b.rank, b.hz); });
    if (others.size() > options.samples.fit.aliases_listed) others.resize(options.samples.fit.aliases_listed);
    std::string list;
    for (const Other& other : others) {
        list += fmt::format("{}{:.6g} Hz ({})", list.empty() ? "" : ", ", other.hz, amplitude(other.hz));
    }
    return fmt::format("{} at {:.6g} Hz may be the alias of another line: {}", effect.name(), line.hz, list);
}

void take_line(const SampleFit& fit, std::size_t cosine, const record::Declared& declared, double from_hz_sd,
               std::vector<Estimate>& all, std::vector<std::string>& notes) {
    const SampleSeries& series = fit.series();
    const auto& columns = fit.model().columns;
    const SampleColumn& column = columns[cosine];
    const effects::Effect& effect = *column.effect;
    const auto frequencies = parameters_of(effect, Role::frequency);
    const FrequencyTrack& track = column.track;
    const double a = column.value;
    const double b = columns[cosine + 1].value;
    const auto slopes = line_slopes(fit, track, a, b);
    const Eigen::MatrixXd joint = fit.joint_covariance(slopes);
    const auto of_a = static_cast<Eigen::Index>(cosine);
    const auto of_hz = static_cast<Eigen::Index>(columns.size());
    const double amplitude = std::max(std::hypot(a, b), 1e-300);
    // Derivatives of the amplitude by a and b
    const Eigen::Vector2d along(a / amplitude, b / amplitude);
    const double amplitude_sd = std::sqrt(std::max(0.0, along.dot(joint.block<2, 2>(of_a, of_a) * along)));
    const Unaliased real = unaliased(track.hz, fit, declared);
    const double hz_sd = std::sqrt(std::max(0.0, joint(of_hz, of_hz)));
    if (on_samples(effect) == OnSamples::angle_line) {
        all.push_back(
            estimate_of(effect, frequencies[0]->name, real.hz, std::hypot(hz_sd, real.from_hz_times * from_hz_sd)));
        if (track.free == 1 && frequencies.size() > 1) {
            // The drift is held at zero; the error is that of a drift that was fitted.
            FrequencyTrack drifting = track;
            drifting.free = 2;
            const auto more = fit.joint_covariance(line_slopes(fit, drifting, a, b));
            const double sd = std::sqrt(std::max(0.0, more(of_hz + 1, of_hz + 1)));
            all.push_back(estimate_of(effect, frequencies[1]->name, 0.0, sd));
        }
        for (std::size_t k = 1; k < std::min(track.free, frequencies.size()); ++k) {
            const auto at = of_hz + static_cast<Eigen::Index>(k);
            all.push_back(estimate_of(effect, frequencies[k]->name, real.drift_sign * track.coefficient(k),
                                      std::sqrt(std::max(0.0, joint(at, at)))));
        }
        const double gain = std::max(1e-9, 2.0 * std::abs(std::sin(units::pi * track.hz * series.interval_s)));
        all.push_back(
            estimate_of(effect, parameter_of(effect, Role::sampled).name, amplitude / gain, amplitude_sd / gain));
        notes.push_back(note_on_aliases(real, fit, declared, effect,
                                        [&](double) { return fmt::format("{:.3g} arcsec", amplitude / gain); }));
        return;
    }
    all.push_back(estimate_of(effect, frequencies[0]->name, track.hz, hz_sd));
    // Increments are integrals of a rate over each interval.
    const double gain = std::sin(units::pi * track.hz * series.interval_s) / (units::pi * track.hz);
    all.push_back(estimate_of(effect, parameter_of(effect, Role::size).name, amplitude / std::abs(gain),
                              amplitude_sd / std::abs(gain)));
    notes.push_back(note_on_aliases({track.hz}, fit, declared, effect, [&](double hz) {
        const double integrated = std::sin(units::pi * hz * series.interval_s) / (units::pi * hz);
        return fmt::format("{:.3g} deg/h", amplitude / std::max(std::abs(integrated), 1e-12));
    }));
    // a cos + b sin = A sin(phase + 2 pi f (t + middle)), t from the middle
    const double middle_s = middle_of(series);
    const double turns = track.hz * middle_s;
    const double sign = std::copysign(1.0, gain);
    const double phase = std::atan2(sign * a, sign * b) - units::two_pi * (turns - std::floor(turns));
    Eigen::VectorXd by = Eigen::VectorXd::Zero(joint.rows());
    by(of_a) = b / (amplitude * amplitude);
    by(of_a + 1) = -a / (amplitude * amplitude);
    by(of_hz) = -units::two_pi * middle_s;
    all.push_back(estimate_of(effect, parameter_of(effect, Role::phase).name, std::remainder(phase, units::two_pi),
                              std::sqrt(std::max(0.0, by.dot(joint * by)))));
}

/// Mean and standard deviation of the time of a step under its likelihood, which is not parabolic.
Estimate time_of_step(const SampleFit& fit, std::size_t at) {
    const SampleSeries& series = fit.series();
    const std::size_t n = series.size();
    const SampleColumn& column = fit.model().columns[at];
    const std::size_t row = row_of_step(column);
    SampleModel model = fit.model();
    model.columns.erase(model.columns.begin() + static_cast<std::ptrdiff_t>(at));
    const SampleFit without(series, std::move(model), fit.rows(), SampleFit::Noise::held);
    const auto chi2_at = [&](std::size_t place) { return std::pow(root_of_step(without, place), 2); };
    const double top = chi2_at(row);
    // Up to where the likelihood is negligible on either side, then in even steps
    std::size_t reach = 1;
    while (reach < n / 4) {
        const std::size_t before = row > reach ? row - reach : 1;
        const std::size_t after = std::min(n - 2, row + reach);
        if (top - chi2_at(before) > 25.0 && top - chi2_at(after) > 25.0) break;
        reach *= 2;
    }
    const std::size_t step = std::max<std::size_t>(1, reach / 40);
    double sum = 0.0;
    double first = 0.0;
    double second = 0.0;
    for (std::size_t k = row > reach ? row - reach : 1; k <= std::min(n - 2, row + reach); k += step) {
        const double weight = std::exp(0.5 * (chi2_at(k) - top));
        const double time = series.time_s[k] - series.interval_s - series.time_s[row];
        sum += weight;
        first += weight * time;
        second += weight * time * time;
    }
    const double mean = first / sum;
    // The time within a row is not determined.
    const double within = series.interval_s * static_cast<double>(step);
    return estimate_of(*column.effect, parameter_of(*column.effect, Role::time).name, series.time_s[row] + mean,
                       std::sqrt(std::max(0.0, second / sum - mean * mean) + within * within / 12.0));
}

double of_readings_hz(const SampleFit& fit) {
    return fit.model().noise.from_hz > 0.0 ? fit.model().noise.from_hz : fit.series().rate_hz;
}

/// Mean square of a resonance's angle between two frequencies, by the spectrum of its autoregression.
double power_between(const SampleNoise::Resonance& resonance, double from_hz, double to_hz, double rate_hz) {
    constexpr int parts = 64;
    const double r = std::exp(-units::pi * resonance.width_hz / rate_hz);
    const double a = 2.0 * r * std::cos(units::two_pi * resonance.hz / rate_hz);
    const double b = r * r;
    const double driven = resonance.arcsec * resonance.arcsec * (1.0 - b) * ((1.0 + b) * (1.0 + b) - a * a) / (1.0 + b);
    const double low = std::max(from_hz, 0.0);
    const double width = (std::min(to_hz, 0.5 * rate_hz) - low) / parts;
    double sum = 0.0;
    for (int k = 0; k < parts; ++k) {
        const double w = units::two_pi * (low + (k + 0.5) * width) / rate_hz;
        const std::complex<double> z = std::polar(1.0, -w);
        sum += 2.0 / rate_hz * driven / std::norm(1.0 - a * z + b * z * z) * width;
    }
    return sum;
}

/// Part of a motion that a witness does not predict, with the relative errors of the amplitudes.
struct Incoherent {
    std::vector<SampleNoise::Resonance> resonances;
    std::vector<double> relative;
};

Incoherent incoherent_in(const SampleFit& fit, int step) {
    const SampleModel errors = fit.noise_errors();
    Incoherent incoherent;
    for (std::size_t k = 0; k < fit.model().resonances.size(); ++k) {
        if (fit.model().resonances[k].step != step) continue;
        const SampleNoise::Resonance& resonance = fit.model().noise.resonances[k];
        incoherent.resonances.push_back(resonance);
        incoherent.relative.push_back(errors.noise.resonances[k].arcsec / std::max(resonance.arcsec, 1e-12));
    }
    return incoherent;
}

/// A weak motion is predicted by two numbers only, since a response of many lags would be mostly noise: the unpredicted
/// part is the motion's resonance, fitted next to these.
Incoherent incoherent_with_motion_held(const SampleFit& fit, const SampleFit& whole) {
    SampleModel held = whole.model();
    held.motion.assign(fit.series().size(), 0.0);
    for (const SampleColumn& column : fit.model().columns) {
        if (!is_motion(column.effect)) continue;
        for (std::size_t i = 0; i < held.motion.size(); ++i) held.motion[i] += column.value * (*column.series)[i];
    }
    const SampleFit left(fit.series(), std::move(held), fit.rows(), SampleFit::Noise::near);
    const SampleNoise::Resonance& resonance = left.model().noise.resonances.front();
    const double sd = left.noise_errors().noise.resonances.front().arcsec;
    return {{resonance}, {sd / std::max(resonance.arcsec, 1e-12)}};
}

/// The motion's angle as a resonance of its own, without any prediction from the witness. In the model without the
/// motion, other noises may have absorbed it; the noises that were fitted with it are therefore tried as a start as
/// well.
SampleFit motion_as_resonance(const SampleFit& fit, const SampleFit& bare, const WitnessMotion& fitted,
                              const ResonanceOwner& owner) {
    const double centre_hz = std::max(fitted.centre_hz, 0.01);
    std::optional<SampleFit> best;
    for (const SampleModel& from : {bare.model(), without_motion(fit.model())}) {
        SampleModel with = bare.model();
        with.noise = from.noise;
        with.flicker_deg_h = from.flicker_deg_h;
        with.motion_from_hz = options.samples.fit.slowest_of_motion * centre_hz;
        with.resonances.insert(with.resonances.begin(), owner);
        with.noise.resonances.insert(with.noise.resonances.begin(),
                                     {std::max(fitted.rms_arcsec, 1e-6), centre_hz, 0.5 * centre_hz});
        SampleFit whole(fit.series(), std::move(with), fit.rows(), SampleFit::Noise::free);
        if (!best || whole.log_likelihood() > best->log_likelihood()) best.emplace(std::move(whole));
    }
    return std::move(*best);
}

std::vector<Estimate> whites_of(const SampleNoise& noise, const SampleNoise& errors) {
    const double to_deg = units::deg_rt_h_per_arcsec_rt_s;
    return {{"", "white_angle_arcsec", noise.angle_arcsec, errors.angle_arcsec},
            {"", "white_rate_deg_rt_h", noise.rate_arcsec_rt_s * to_deg, errors.rate_arcsec_rt_s * to_deg}};
}

/// Parameters of a motion, and the part that its witness does not predict.
void take_motion(const SampleFit& fit, const AddedEffect& added, std::vector<Estimate>& all,
                 std::vector<Estimate>& whites, std::vector<std::string>& notes) {
    const SampleSeries& series = fit.series();
    const auto& [name, witness] = series.witnesses[added.witness];
    const auto take = [&](std::string_view parameter, double value, double sd) -> Estimate& {
        const effects::Effect& effect = added.effect();
        return all.emplace_back(estimate_of(effect, parameter_of(effect, parameter).name, value, sd));
    };
    take("witness", static_cast<double>(name.back() - 'x'), 0.0).text = name;
    const SampleFit bare(series, without_motion(fit.model()), fit.rows(), SampleFit::Noise::near);
    const WitnessMotion fitted = fit_witness(bare, witness);
    const double centre = std::max(fitted.centre_hz, 0.01);
    const SampleFit whole = motion_as_resonance(fit, bare, fitted, {&added.effect(), added.id});
    const auto& motion = whole.model().noise.resonances.front();
    const SampleNoise errors = whole.noise_errors().noise;
    const SampleNoise::Resonance& error = errors.resonances.front();
    const bool seen = whole.log_likelihood() - bare.log_likelihood() > options.samples.fit.motion_stands_out;
    // A strong motion as predicted from the witness contains the witness's own noise, which is no noise of the gyro. A
    // motion that is not a resonance leaves a larger white angle in this model; then the fitted one is kept.
    if (seen && added.strong && whole.model().noise.angle_arcsec < fit.model().noise.angle_arcsec) {
        whites = whites_of(whole.model().noise, errors);
    }
    double coherence = unknown;
    double coherence_sd = unknown;
    if (seen) {
        // Power that is still needed in addition to the prediction, in the band of the motion: elsewhere it is power
        // that the witness cannot predict.
        const Incoherent incoherent =
            added.strong ? incoherent_in(fit, added.id) : incoherent_with_motion_held(fit, whole);
        const auto power = [&](const SampleNoise::Resonance& of) {
            return power_between(of, motion.hz - motion.width_hz, motion.hz + motion.width_hz, of_readings_hz(fit));
        };
        double squares = 0.0;
        double squares_sd = 0.0;
        for (std::size_t k = 0; k < incoherent.resonances.size(); ++k) {
            const double part = power(incoherent.resonances[k]);
            squares += part;
            if (incoherent.relative[k] > 0.0) squares_sd += std::pow(2.0 * part * incoherent.relative[k], 2);
        }
        squares_sd = std::sqrt(squares_sd);
        const double all_of_it = power(motion);
        const double left = std::min(1.0, squares / all_of_it);
        coherence = 1.0 - left;
        const double relative = 0.5 * squares_sd / std::max(squares, 1e-300);
        // For n independent spectra: (1 - c) sqrt(2 c/n) (Bendat and Piersol 2010, table 9.6); the logarithm of their
        // power has the standard error 1/sqrt(n).
        coherence_sd = relative < options.samples.fit.small_relative_sd ? left * std::sqrt(8.0 * coherence) * relative
                                                                        : squares_sd / all_of_it;
    } else {
        notes.push_back(
            "the motion is known only from its witness: its own spectrum does not exceed the noise, "
            "so that coherence, rms, centre and width have no standard error");
    }
    take("coherence", seen ? coherence : fitted.coherence, coherence_sd);
    take("rms_arcsec", seen ? motion.arcsec : fitted.rms_arcsec, seen ? error.arcsec : unknown);
    take("centre_hz", seen ? motion.hz : centre, seen ? error.hz : unknown);
    take("width_hz", seen ? motion.width_hz : 0.5 * centre, seen ? error.width_hz : unknown);
}

/// Growth of the variance of the rate [(arcsec/s)^2/s] at unit deviation; 1 deg/h is 1 arcsec/s.
double walk_of_unit(const effects::Effect& effect) { return effect.rate_noise(unit_values(effect)).walk_deg2_h2_per_s; }

void take_walk(const effects::Effect& effect, const SampleNoise& noise, const SampleNoise& errors,
               std::vector<Estimate>& all) {
    // The parameter of the walk is a variance; the relative error of its root is half.
    const double deviation = deviation_of_walk(effect, noise);
    const double sd = 0.5 * errors.walk_arcsec2_s3 / walk_of_unit(effect) / std::max(deviation, 1e-300);
    all.push_back(estimate_of(effect, parameter_of(effect, Role::deviation).name, deviation, sd));
}

void take_resampling(const SampleFit& fit, const AddedEffect& added, double from_hz_sd, std::vector<Estimate>& all,
                     std::vector<std::string>& notes) {
    const std::string_view parameter = parameter_of(added.effect(), Role::sampled).name;
    const double from_hz = fit.model().noise.from_hz;
    all.push_back(estimate_of(added.effect(), parameter, from_hz, added.other_hz.empty() ? from_hz_sd : unknown));
    for (const double hz : added.other_hz) {
        notes.push_back(
            fmt::format("a source of {:.6g} Hz explains the record as well as {:.6g} Hz: {} has no standard error", hz,
                        from_hz, parameter));
    }
}

/// A phase-incoherent line, as a narrow resonance.
void take_wandering(const SampleFit& fit, std::size_t resonance, const SampleNoise& errors,
                    const record::Declared& declared, std::vector<Estimate>& all) {
    const effects::Effect& effect = *fit.model().resonances[resonance].effect;
    const auto& line = fit.model().noise.resonances[resonance];
    const auto& sd = errors.resonances[resonance];
    const Unaliased real = unaliased(line.hz, fit, declared);
    all.push_back(estimate_of(effect, parameter_of(effect, Role::frequency).name, real.hz,
                              std::hypot(sd.hz, real.from_hz_times * errors.from_hz)));
    all.push_back(estimate_of(effect, parameter_of(effect, Role::sampled).name, std::numbers::sqrt2 * line.arcsec,
                              std::numbers::sqrt2 * sd.arcsec));
    all.push_back(estimate_of(effect, "wander_hz", line.width_hz, sd.width_hz));
}

}  // namespace

double deviation_of_walk(const effects::Effect& effect, const SampleNoise& noise) {
    return std::sqrt(noise.walk_arcsec2_s3 / walk_of_unit(effect));
}

SampleFigures figures_of(const SampleFit& fit, const std::vector<AddedEffect>& added,
                         const record::Declared& declared) {
    const SampleModel& model = fit.model();
    const SampleModel errors = fit.noise_errors();
    SampleFigures figures;
    // The mean rate is that at the temperature of the start.
    double of_start = 0.0;
    for (const SampleColumn& column : model.columns) {
        if (column.effect == nullptr || on_samples(*column.effect) != OnSamples::rate) continue;
        of_start += column.value * rate_per_kelvin(*column.effect) * fit.series().temperature_start_sd_k;
    }
    figures.base.push_back({"", "mean_rate_deg_h", model.columns[0].value, std::hypot(model.columns[0].sd, of_start)});
    std::vector<Estimate> whites = whites_of(model.noise, errors.noise);
    for (const AddedEffect& one : added) {
        auto& all = figures.steps.emplace_back();
        figures.step_notes.emplace_back();
        const effects::Effect& effect = one.effect();
        const OnSamples as = on_samples(effect);
        if (as == OnSamples::motion) {
            take_motion(fit, one, all, whites, figures.notes);
            continue;
        }
        for (std::size_t k = 0; k < model.columns.size(); ++k) {
            const SampleColumn& column = model.columns[k];
            if (column.step != one.id || column.effect != &effect || column.name == "sine") continue;
            if (column.name == "cosine") {
                take_line(fit, k, declared, errors.noise.from_hz, all, figures.step_notes.back());
                continue;
            }
            all.push_back(estimate_of(effect, column.name, column.value, column.sd));
            if (as == OnSamples::step) all.push_back(time_of_step(fit, k));
        }
        if (as == OnSamples::walk) take_walk(effect, model.noise, errors.noise, all);
        if (as == OnSamples::flicker) {
            all.push_back(estimate_of(effect, parameter_of(effect, Role::deviation).name, model.flicker_deg_h,
                                      errors.flicker_deg_h));
        }
        if (as == OnSamples::transport) take_resampling(fit, one, errors.noise.from_hz, all, figures.step_notes.back());
        const auto own = std::find_if(model.resonances.begin(), model.resonances.end(),
                                      [&](const ResonanceOwner& owner) { return owner.step == one.id; });
        if (own == model.resonances.end()) continue;
        take_wandering(fit, static_cast<std::size_t>(own - model.resonances.begin()), errors.noise, declared, all);
    }
    figures.base.insert(figures.base.end(), whites.begin(), whites.end());
    return figures;
}

}  // namespace ringlock::closure
