#include "app/allan/output/density_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include "analysis/allan/sums/phase.hpp"
#include "app/allan/data_phase.hpp"
#include "app/allan/output/csv.hpp"
#include "app/allan/several.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

constexpr std::size_t fewest_rates = 8;

/// Means over tau0, NaN where one of the two points of phase is missing.
std::vector<double> rates_of(const allan::Phase& phase, double tau0_s) {
    std::vector<double> out;
    for (std::size_t i = 1; i < phase.x.size(); ++i) out.push_back((phase.x[i] - phase.x[i - 1]) / tau0_s);
    // A stretch whose phase has an origin of its own begins with a step that is none of the data.
    if (!phase.one_origin) {
        for (const allan::Stretch& s : phase.stretches) {
            if (s.begin > 0) out[s.begin - 1] = std::numeric_limits<double>::quiet_NaN();
        }
    }
    return out;
}

/// The longest part without gaps.
std::span<const double> longest_part(const std::vector<double>& rates) {
    std::size_t best = 0;
    std::size_t best_begin = 0;
    std::size_t begin = 0;
    for (std::size_t i = 0; i <= rates.size(); ++i) {
        if (i < rates.size() && !std::isnan(rates[i])) continue;
        if (i - begin > best) {
            best = i - begin;
            best_begin = begin;
        }
        begin = i + 1;
    }
    return std::span(rates).subspan(best_begin, best);
}

/// "_deg2_h2_per_hz"
std::string density_suffix(const AllanOutput& out) {
    if (!out.instrument || *out.instrument == quantity::Instrument::clock) return "_per_hz";
    return *out.instrument == quantity::Instrument::gyro ? "_deg2_h2_per_hz" : "_m2_s4_per_hz";
}

std::string density_unit(const AllanOutput& out) {
    if (!out.instrument || *out.instrument == quantity::Instrument::clock) return "1/Hz";
    return *out.instrument == quantity::Instrument::gyro ? "(deg/h)²/Hz" : "(m/s²)²/Hz";
}

std::string_view sides_of(const DensityChoice& choice) { return choice.one_sided ? "one_sided" : "two_sided"; }

}  // namespace

DensityChoice density_choice(const std::string& method, const std::string& sides) {
    if (method != "welch" && method != "cosine") {
        throw InputError(
            fmt::format("--psd-method {}: must be welch (Hann window, segments that overlap by half) or "
                        "cosine (the spectrum that the coefficients are fitted to)",
                        printable(method)));
    }
    if (sides != "one" && sides != "two") {
        throw InputError(
            fmt::format("--psd-sides {}: must be two (the density of which N^2 is the level of white noise) "
                        "or one (twice that, as spectrum analysers show it)",
                        printable(sides)));
    }
    return {.cosine = method == "cosine", .one_sided = sides == "one"};
}

SeriesDensity density_of(const AllanRequest& request, const AnalysedSeries& series, const DensityChoice& choice) {
    const double tau0_s = series.out.tau0_s;
    const std::vector<double> rates = rates_of(phase_of_data(request, series), tau0_s);
    const std::span<const double> longest = longest_part(rates);
    const std::string name = fmt::format("{}, column {}", printable(series.out.data), printable(series.out.column));
    if (longest.size() < fewest_rates) {
        throw InputError(fmt::format("--psd: {}: the longest part without gaps has {} rates; a spectrum needs {}", name,
                                     longest.size(), fewest_rates));
    }
    SeriesDensity out;
    if (choice.cosine) {
        out.points = stability::cosine_density(longest, tau0_s);
    } else {
        out.segment = std::min(stability::welch_segment(rates.size()), longest.size());
        out.points = stability::welch_density(rates, tau0_s, out.segment);
    }
    if (series.out.noise && series.out.noise->described && !series.out.noise_thinning) {
        std::vector<double> frequencies_hz;
        for (const auto& p : out.points) frequencies_hz.push_back(p.frequency_hz);
        out.model = stability::model_density(*series.out.noise, tau0_s, frequencies_hz);
    }
    if (choice.one_sided) {
        // Half the sampling rate stands for both sides already.
        const double last_hz = 0.5 / tau0_s * (1.0 - 1e-9);
        for (std::size_t i = 0; i < out.points.size(); ++i) {
            if (out.points[i].frequency_hz > last_hz) continue;
            out.points[i].density *= 2.0;
            if (!out.model.empty()) out.model[i] *= 2.0;
        }
    }
    return out;
}

std::string density_csv(const std::vector<AllanOutput>& series, const std::vector<SeriesDensity>& densities,
                        const DensityChoice& choice) {
    const std::string suffix = fmt::format("_{}{}", sides_of(choice), density_suffix(series.front()));
    std::string text = csv_line({"file", "column", "frequency_hz", "psd" + suffix, "model" + suffix,
                                 choice.cosine ? "coefficients" : "segments", "method"});
    for (std::size_t k = 0; k < series.size(); ++k) {
        const SeriesDensity& d = densities[k];
        const std::string method = choice.cosine ? "cosine" : fmt::format("welch hann {}", d.segment);
        for (std::size_t i = 0; i < d.points.size(); ++i) {
            text += csv_line({csv_cell(series[k].data), csv_cell(series[k].column), csv_cell(d.points[i].frequency_hz),
                              csv_cell(d.points[i].density), d.model.empty() ? "" : csv_cell(d.model[i]),
                              std::to_string(d.points[i].count), method});
        }
    }
    return text;
}

report::Figure density_figure(const std::vector<AllanOutput>& series, const std::vector<SeriesDensity>& densities,
                              const DensityChoice& choice) {
    const std::vector<std::string> names = names_of_series(series);
    report::Figure figure;
    figure.title = fmt::format("{}-sided power spectral density, {}", choice.one_sided ? "One" : "Two",
                               choice.cosine ? "cosine spectrum of the noise fit" : "Welch, Hann window");
    figure.x_label = "frequency [Hz]";
    figure.y_label = fmt::format("density [{}]", density_unit(series.front()));
    figure.log_x = figure.log_y = true;
    for (std::size_t k = 0; k < series.size(); ++k) {
        const std::string name =
            series.size() == 1 ? fmt::format("{}, column {}", printable(series[k].data), printable(series[k].column))
                               : printable(names[k]);
        report::Curve curve{.label = name, .style = report::Curve::Style::line};
        curve.colour = k;
        for (const auto& p : densities[k].points) {
            curve.x.push_back(p.frequency_hz);
            curve.y.push_back(p.density);
        }
        if (!densities[k].model.empty()) {
            figure.curves.push_back({.label = series.size() == 1 ? "fitted noise" : "fitted noise, " + name,
                                     .x = curve.x,
                                     .y = densities[k].model,
                                     .style = report::Curve::Style::dashed});
        }
        figure.curves.push_back(std::move(curve));
    }
    return figure;
}

}  // namespace ringlock::app
