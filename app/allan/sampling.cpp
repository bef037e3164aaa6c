#include "app/allan/sampling.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>
#include <system_error>
#include <utility>

#include "app/arguments.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

std::optional<double> plain_number(std::string_view text) {
    if (text.starts_with('+')) text.remove_prefix(1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

/// Numerator and denominator; the denominator of a number without a stroke is 1.
std::optional<std::pair<double, double>> fraction(std::string_view text) {
    const std::size_t stroke = text.find('/');
    const auto above = plain_number(text.substr(0, stroke));
    const auto below = stroke == std::string_view::npos ? 1.0 : plain_number(text.substr(stroke + 1));
    if (!above || !below) return std::nullopt;
    return std::pair{*above, *below};
}

bool is_positive(double value) { return value > 0.0 && std::isfinite(value); }

Sampling by_rate(const std::string& rate) {
    Sampling out{.said = "--rate " + rate};
    if (rate == "file") {
        out.from_file = true;
        return out;
    }
    if (const auto parts = fraction(rate)) {
        out.rate_hz = parts->first / parts->second;
        out.tau0_s = parts->second / parts->first;
    }
    if (is_positive(out.rate_hz) && is_positive(out.tau0_s)) return out;
    throw InputError(
        fmt::format("--rate {}: must be a positive number of samples a second, a fraction such as 1/300, "
                    "or file where the file declares its rate_hz",
                    rate));
}

Sampling by_interval(const std::string& tau0) {
    Sampling out{.said = "--tau0 " + tau0};
    if (const auto parts = fraction(tau0)) {
        out.tau0_s = parts->first / parts->second;
        out.rate_hz = parts->second / parts->first;
    } else if (const auto time = averaging_time(tau0); time && time->time_s) {
        out.tau0_s = *time->time_s;
        out.rate_hz = 1.0 / out.tau0_s;
    }
    if (is_positive(out.rate_hz) && is_positive(out.tau0_s)) return out;
    throw InputError(fmt::format(
        "--tau0 {}: must be the positive number of seconds from one sample to the next, as 0.005, 1/200 or 5ms", tau0));
}

}  // namespace

Sampling sampling_of(const std::string& rate, const std::string& tau0) {
    if (!rate.empty() && !tau0.empty()) {
        throw InputError(
            fmt::format("--rate {} and --tau0 {}: both say how far samples are apart; give one of them", rate, tau0));
    }
    if (!rate.empty()) return by_rate(rate);
    if (!tau0.empty()) return by_interval(tau0);
    throw InputError(
        "--rate is required: samples a second, as 100 or 1/300, or file where the file declares its rate_hz; --tau0 "
        "says the sampling interval in seconds instead");
}

Sampling declared_sampling(const std::string& file, const std::optional<double>& rate_hz) {
    if (!rate_hz) {
        throw InputError(fmt::format("{}: declares no rate_hz, which --rate file asks for; say --rate HZ or --tau0 S",
                                     printable(file)));
    }
    return {.said = "--rate file", .from_file = true, .rate_hz = *rate_hz, .tau0_s = 1.0 / *rate_hz};
}

}  // namespace ringlock::app
