#include "app/allan/output/explain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include "analysis/noise/allan_variance.hpp"

namespace ringlock::app {
namespace {

/// The nouns of an instrument.
struct Nouns {
    std::string_view integral;  ///< "angle"
    std::string_view rate;      ///< "rate"
};

Nouns nouns_of(quantity::Instrument instrument) {
    switch (instrument) {
        case quantity::Instrument::accelerometer:
            return {"velocity", "acceleration"};
        case quantity::Instrument::clock:
            return {"time error", "fractional frequency"};
        case quantity::Instrument::gyro:
            break;
    }
    return {"angle", "rate"};
}

/// Meanings of Q, N, B, K and R; {0} is the integral, {1} the rate.
std::string meaning_of(char letter, const Nouns& nouns) {
    switch (letter) {
        case 'Q':
            return fmt::format(
                "is the rms error of a single value of the {0}, independent from one value to the next, such as that "
                "of quantisation; its Allan deviation falls as 1/tau",
                nouns.integral);
        case 'N':
            return fmt::format(
                "is the strength of white noise of the {1}: it makes the {0} wander by N times the square root of the "
                "time; its Allan deviation falls as tau^-1/2",
                nouns.integral, nouns.rate);
        case 'B':
            return fmt::format(
                "is the strength of flicker noise of the {0}; its Allan deviation is flat at 0.664 B, and averaging "
                "over longer times does not reduce it",
                nouns.rate);
        case 'K':
            return fmt::format(
                "is the strength of a random walk of the {0}, the steps of which add up over time; its Allan deviation "
                "rises as tau^1/2",
                nouns.rate);
        default:
            return fmt::format("is a steady change of the {0} over the record; its Allan deviation rises as tau",
                               nouns.rate);
    }
}

/// Where a term of the fit shows on the curve.
struct Place {
    std::optional<std::array<double, 2>> leads_s;  ///< first and last averaging time at which no term is larger
    double largest_share = 0.0;                    ///< of the variance
    double at_s = 0.0;                             ///< where it has that share
};

/// Averaging times that a record has, close together.
std::vector<double> averaging_times(const AllanOutput& out) {
    const double last_s = std::max(out.tau0_s * static_cast<double>(out.n) / 2.0, 2.0 * out.tau0_s);
    constexpr int a_decade = 50;
    const int steps = std::max(1, static_cast<int>(std::ceil(a_decade * std::log10(last_s / out.tau0_s))));
    std::vector<double> tau_s;
    for (int i = 0; i <= steps; ++i) tau_s.push_back(out.tau0_s * std::pow(last_s / out.tau0_s, 1.0 * i / steps));
    return tau_s;
}

Place place_of(std::string_view term, const std::vector<noise::VarianceTerm>& terms, const std::vector<double>& tau_s) {
    Place place;
    for (std::size_t i = 0; i < tau_s.size(); ++i) {
        double sum = 0.0;
        double largest = 0.0;
        double own = 0.0;
        for (const noise::VarianceTerm& t : terms) {
            sum += t.variances[i];
            largest = std::max(largest, t.variances[i]);
            if (t.name == term) own = t.variances[i];
        }
        if (own == largest && own > 0.0) place.leads_s = {place.leads_s ? (*place.leads_s)[0] : tau_s[i], tau_s[i]};
        if (own > place.largest_share * sum) {
            place.largest_share = own / sum;
            place.at_s = tau_s[i];
        }
    }
    return place;
}

std::string place_sentence(const Place& place) {
    if (place.leads_s) {
        return fmt::format(
            "It is the largest part of the fitted Allan variance from tau = {:.3g} s to {:.3g} s; that range of the "
            "curve determines it.",
            (*place.leads_s)[0], (*place.leads_s)[1]);
    }
    return fmt::format(
        "At no averaging time of the record is it the largest part of the fitted Allan variance; its share is largest "
        "at tau = {:.3g} s, {:.2g} %, and the fit to the whole spectrum determines it.",
        place.at_s, 100.0 * place.largest_share);
}

std::string with_unit(std::string number, std::string_view unit) {
    if (!unit.empty()) number += fmt::format(" {}", unit);
    return number;
}

/// "frequency random walk K": the table has no room for all of it.
std::string full_name(const CoefficientName& name) {
    std::string full(name.name);
    for (const std::string_view brief : {"r. walk", "r. w."}) {
        if (const std::size_t at = full.find(brief); at != std::string::npos)
            full.replace(at, brief.size(), "random walk");
    }
    return full;
}

std::string coefficient_sentences(const AllanOutput& out, const CoefficientName& name,
                                  const std::vector<noise::VarianceTerm>& terms, const std::vector<double>& tau_s) {
    const std::string_view letter = name.name.substr(name.name.size() - 1);
    const noise::Coefficient& c = (*out.noise).*name.member;
    std::string text =
        fmt::format("The {} {}.", full_name(name), meaning_of(letter.front(), nouns_of(*out.instrument)));
    if (c.resolved) {
        text += fmt::format(" It is {} (68.27 % interval {:.5g} to {:.5g}). {}",
                            with_unit(fmt::format("{:.5g}", name.factor * *c.value), name.unit), name.factor * *c.lo,
                            name.factor * *c.hi, place_sentence(place_of(letter, terms, tau_s)));
        return text;
    }
    text +=
        name.member == &noise::NoiseFit::bias_instability_deg_h
            ? " It is not given: its flat part is nowhere the largest of the curve, or the other terms describe the "
              "record as well without it."
            : " It is not given, because the other terms describe the record as well without it.";
    if (c.hi) {
        text += fmt::format(" The record excludes values above {} at 95 %.",
                            with_unit(fmt::format("{:.3g}", name.factor * *c.hi), name.unit));
    }
    return text;
}

std::string correlated_sentences(const AllanOutput& out, const std::vector<noise::VarianceTerm>& terms,
                                 const std::vector<double>& tau_s) {
    const noise::Correlated& c = *out.noise->correlated;
    return fmt::format(
        "Exponentially correlated noise of the {}, which forgets its past over the correlation time of {:.3g} s, has "
        "an "
        "rms of {}. {}",
        nouns_of(*out.instrument).rate, c.correlation_time_s.value,
        with_unit(fmt::format("{:.4g}", c.rms_rate_deg_h.value), names_of(*out.instrument).rate_unit),
        place_sentence(place_of("correlated", terms, tau_s)));
}

std::string sinusoid_sentence(const AllanOutput& out, const noise::Sinusoid& line) {
    constexpr double hump = 0.371;  // sin^2(pi f tau)/(pi f tau) is largest at f tau = 0.371
    return fmt::format(
        "A sinusoid of {:.6g} Hz has an amplitude of {}; the curve shows it as a hump near tau = {:.3g} s.",
        line.frequency_hz.value,
        with_unit(fmt::format("{:.4g}", line.rate_amplitude_deg_h.value), names_of(*out.instrument).rate_unit),
        hump / line.frequency_hz.value);
}

/// The lowest point of the first deviation.
std::optional<std::string> lowest_point(const AllanOutput& out) {
    if (out.deviations.empty() || out.deviations.front().points.empty()) return std::nullopt;
    const DeviationOutput& d = out.deviations.front();
    const allan::Point& p =
        *std::min_element(d.points.begin(), d.points.end(), [](const auto& a, const auto& b) { return a.dev < b.dev; });
    std::string_view unit;
    if (out.instrument) {
        const InstrumentNames& names = names_of(*out.instrument);
        unit = allan::traits(d.estimator).time ? names.integral_unit : names.rate_unit;
    }
    return fmt::format("The lowest {} of the table is {} at tau = {:.4g} s.", allan::name(d.estimator),
                       with_unit(fmt::format("{:.4g}", p.dev), unit), p.tau_s);
}

/// Greedy lines of words.
std::string wrapped(const std::string& text, std::size_t width) {
    std::string out;
    std::size_t column = 0;
    std::size_t begin = 0;
    while (begin < text.size()) {
        const std::size_t end = std::min(text.find(' ', begin), text.size());
        if (column > 0 && column + 1 + (end - begin) > width) {
            out += '\n';
            column = 0;
        } else if (column > 0) {
            out += ' ';
            ++column;
        }
        out.append(text, begin, end - begin);
        column += end - begin;
        begin = end + 1;
    }
    return out + "\n";
}

}  // namespace

std::vector<std::string> explanation(const AllanOutput& out) {
    std::vector<std::string> sentences;
    if (const auto lowest = lowest_point(out)) sentences.push_back(*lowest);
    if (!out.noise) {
        sentences.emplace_back("Noise coefficients have units: without --unit none are estimated.");
        return sentences;
    }
    if (!out.noise->described) {
        sentences.push_back(
            fmt::format("No noise coefficient is given: {}. Each value would be wrong by more than its interval.",
                        out.noise->reason));
        return sentences;
    }
    if (!out.findings.empty()) {
        const std::string without = findings::estimated_without(out.findings);
        sentences.push_back(fmt::format(
            "{} fault{} found in the data{}.", out.findings.size(), out.findings.size() == 1 ? " was" : "s were",
            without.empty() ? "" : fmt::format("; the coefficients are estimated without {}", without)));
    }
    const std::vector<double> tau_s = averaging_times(out);
    const auto terms = noise::variance_terms(*out.noise, tau_s);
    for (const CoefficientName& name : names_of(*out.instrument).coefficients) {
        sentences.push_back(coefficient_sentences(out, name, terms, tau_s));
    }
    if (out.noise->correlated) sentences.push_back(correlated_sentences(out, terms, tau_s));
    for (const noise::Sinusoid& line : out.noise->sinusoids) sentences.push_back(sinusoid_sentence(out, line));
    return sentences;
}

std::string explanation_text(const AllanOutput& out, std::size_t width) {
    std::string text;
    for (const std::string& sentence : explanation(out)) text += "\n" + wrapped(sentence, width);
    return text;
}

}  // namespace ringlock::app
