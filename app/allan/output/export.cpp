#include "app/allan/output/export.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <sstream>
#include <string_view>

#include "app/allan/several.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/version.hpp"

namespace ringlock::app {
namespace {

using noise::NoiseFit;
using quantity::Instrument;

constexpr double s_per_h = 3600.0;
constexpr double rt_s_per_rt_h = 60.0;
constexpr double rad_per_deg = std::numbers::pi / 180.0;

/// Coefficients in units of the SI: the names of the units and factors from those of a CoefficientName.
struct SiUnit {
    std::string_view key;  ///< in TOML
    std::string_view unit;
    double factor;
};

/// In the order Q, N, B, K, R. (x/sqrt(h)) is x/(60 sqrt(s)), and 1/sqrt(s) is (1/s)/sqrt(Hz).
constexpr std::array<SiUnit, 5> gyro_si = {{
    {"rad", "rad", rad_per_deg / s_per_h},
    {"rad_s_rt_hz", "rad/s/sqrt(Hz)", rad_per_deg / rt_s_per_rt_h},
    {"rad_s", "rad/s", rad_per_deg / s_per_h},
    {"rad_s2_rt_hz", "rad/s^2/sqrt(Hz)", rad_per_deg / s_per_h / rt_s_per_rt_h},
    {"rad_s2", "rad/s^2", rad_per_deg / s_per_h / s_per_h},
}};
constexpr std::array<SiUnit, 5> accelerometer_si = {{
    {"m_s", "m/s", 1.0},
    {"m_s2_rt_hz", "m/s^2/sqrt(Hz)", 1.0 / rt_s_per_rt_h},
    {"m_s2", "m/s^2", 1.0},
    {"m_s3_rt_hz", "m/s^3/sqrt(Hz)", 1.0 / rt_s_per_rt_h},
    {"m_s3", "m/s^3", 1.0 / s_per_h},
}};

enum Letter : std::size_t { q, n, b, k, r };

/// In units of the SI, the coefficient of one series; not resolved where it has a limit only.
noise::Coefficient in_si(const AllanOutput& out, Letter letter) {
    const CoefficientName& name = names_of(*out.instrument).coefficients[letter];
    const double factor = *out.instrument == Instrument::gyro            ? gyro_si[letter].factor
                          : *out.instrument == Instrument::accelerometer ? accelerometer_si[letter].factor
                                                                         : 1.0;
    noise::Coefficient c = (*out.noise).*name.member;
    for (std::optional<double>* v : {&c.value, &c.lo, &c.hi}) {
        if (*v) **v *= name.factor * factor;
    }
    return c;
}

std::string in_words(const noise::Coefficient& c, std::string_view unit) {
    if (c.resolved) return fmt::format("{:.6g} {} ({:.4g} to {:.4g})", *c.value, unit, *c.lo, *c.hi);
    return c.hi ? fmt::format("not resolved, < {:.3g} {} at 95 %", *c.hi, unit) : "not resolved";
}

void check_series(const std::vector<AllanOutput>& series, std::string_view format) {
    for (const AllanOutput& s : series) {
        const std::string name = fmt::format("{}, column {}", printable(s.data), printable(s.column));
        if (!s.noise) {
            throw InputError(
                fmt::format("--export {}: coefficients have units; say that of the data with --unit", format));
        }
        if (s.noise->described) continue;
        throw InputError(
            fmt::format("--export {}: the coefficients of {} are withheld: {}. Nothing is written, for no "
                        "value would describe this record",
                        format, name, s.noise->reason));
    }
}

std::string made_by(std::string_view mark, const std::vector<AllanOutput>& series) {
    std::string text = fmt::format("{} Made by ringlock {} from\n", mark, version());
    for (const AllanOutput& s : series) {
        text += fmt::format("{}   {}, column {}: {} data, tau0 = {:.9g} s\n", mark, printable(s.data),
                            printable(s.column), s.n, s.tau0_s);
    }
    return text;
}

/// One key of Kalibr: the largest value of the axes, or a comment where none has one.
std::string kalibr_key(std::string_view key, Letter letter, std::string_view unit,
                       const std::vector<AllanOutput>& series) {
    const std::vector<std::string> names = names_of_series(series);
    std::string comments;
    std::optional<double> largest;
    for (std::size_t i = 0; i < series.size(); ++i) {
        const noise::Coefficient c = in_si(series[i], letter);
        if (c.resolved) largest = std::max(largest.value_or(0.0), *c.value);
        comments += fmt::format("# {}: {}\n", printable(names[i]), in_words(c, unit));
    }
    if (largest) return fmt::format("{}{}: {:.9g}\n", comments, key, *largest);
    return fmt::format("{}# {}: not resolved by the record; write a value of your own below the limit\n", comments,
                       key);
}

std::string kalibr(const std::vector<AllanOutput>& series) {
    const bool gyro = *series.front().instrument == Instrument::gyro;
    if (!gyro && *series.front().instrument != Instrument::accelerometer) {
        throw InputError("--export kalibr: imu.yaml has gyros and accelerometers, and the unit is that of a clock");
    }
    for (const AllanOutput& s : series) {
        if (std::abs(s.tau0_s - series.front().tau0_s) > 1e-9 * s.tau0_s) {
            throw InputError(
                fmt::format("--export kalibr: imu.yaml has one update_rate, but the series have sampling intervals of "
                            "{:.9g} s and {:.9g} s; export them by themselves",
                            series.front().tau0_s, s.tau0_s));
        }
    }
    const std::string_view sensor = gyro ? "gyroscope" : "accelerometer";
    const auto& si = gyro ? gyro_si : accelerometer_si;
    std::string text = made_by("#", series);
    text += "# Continuous-time values of the two-sided spectrum, the largest of the axes; 68.27 % intervals.\n";
    text += kalibr_key(fmt::format("{}_noise_density", sensor), n, si[n].unit, series);
    text += kalibr_key(fmt::format("{}_random_walk", sensor), k, si[k].unit, series);
    return text + fmt::format("update_rate: {:.9g}\n", 1.0 / series.front().tau0_s);
}

/// "[1 2 3]", zero where an axis does not resolve the coefficient: MATLAB takes that for no such noise.
std::string matlab_line(std::string_view key, Letter letter, std::string_view unit, bool last,
                        const std::vector<AllanOutput>& series) {
    const std::vector<std::string> names = names_of_series(series);
    std::string values;
    std::string comments;
    for (std::size_t i = 0; i < series.size(); ++i) {
        const noise::Coefficient c = in_si(series[i], letter);
        values += fmt::format("{}{:.9g}", values.empty() ? "" : " ", c.resolved ? *c.value : 0.0);
        comments += fmt::format("    ... {}: {}\n", printable(names[i]), in_words(c, unit));
    }
    if (series.size() > 1) values = "[" + values + "]";
    return fmt::format("{}    '{}', {}{} {}\n", comments, key, values, last ? ");  %" : ", ...", unit);
}

std::string matlab(const std::vector<AllanOutput>& series) {
    const bool gyro = *series.front().instrument == Instrument::gyro;
    if (!gyro && *series.front().instrument != Instrument::accelerometer) {
        throw InputError("--export matlab: imuSensor has gyros and accelerometers, and the unit is that of a clock");
    }
    if (series.size() != 1 && series.size() != 3) {
        throw InputError(
            fmt::format("--export matlab: imuSensor has one value for all axes or one for each of three; "
                        "there are {} series",
                        series.size()));
    }
    const auto& si = gyro ? gyro_si : accelerometer_si;
    std::string text = made_by("%", series);
    text +=
        "% NoiseType single-sided makes the standard deviation of a sample NoiseDensity*sqrt(SampleRate), which is\n"
        "% that of N of the two-sided spectrum. 0 stands for a coefficient that is not resolved.\n";
    text += fmt::format("params = {}('NoiseType', 'single-sided', ...\n", gyro ? "gyroparams" : "accelparams");
    text += matlab_line("NoiseDensity", n, si[n].unit, false, series);
    text += matlab_line("BiasInstability", b, si[b].unit, false, series);
    return text + matlab_line("RandomWalk", k, si[k].unit, true, series);
}

toml::table toml_of(const noise::Coefficient& c) {
    toml::table table;
    if (c.resolved) {
        table.insert("value", *c.value);
        table.insert("lo", *c.lo);
        table.insert("hi", *c.hi);
    } else if (c.hi) {
        table.insert("limit_95", *c.hi);
    }
    return table;
}

std::string in_toml(const std::vector<AllanOutput>& series) {
    toml::array list;
    for (const AllanOutput& s : series) {
        const InstrumentNames& names = names_of(*s.instrument);
        toml::table one{{"data", printable(s.data)},
                        {"column", printable(s.column)},
                        {"instrument", std::string(names.name)},
                        {"tau0_s", s.tau0_s},
                        {"samples", static_cast<std::int64_t>(s.n)}};
        for (const Letter letter : {q, n, b, k, r}) {
            const CoefficientName& name = names.coefficients[letter];
            noise::Coefficient c = (*s.noise).*name.member;
            for (std::optional<double>* v : {&c.value, &c.lo, &c.hi}) {
                if (*v) **v *= name.factor;
            }
            toml::table table = toml_of(c);
            table.insert("unit", std::string(name.unit.empty() ? "1" : name.unit));
            if (*s.instrument != Instrument::clock && c.resolved) {
                const auto& si = *s.instrument == Instrument::gyro ? gyro_si : accelerometer_si;
                table.insert(fmt::format("value_{}", si[letter].key), *in_si(s, letter).value);
            }
            one.insert(std::string(name.key), std::move(table));
        }
        list.push_back(std::move(one));
    }
    std::ostringstream text;
    text << made_by("#", series)
         << "# value: of the noise coefficient, lo and hi: its 68.27 % interval; limit_95: of one that is not "
            "resolved.\n"
         << toml::table{{"series", std::move(list)}} << "\n";
    return text.str();
}

}  // namespace

ExportFormat export_format(const std::string& name) {
    if (name == "kalibr") return ExportFormat::kalibr;
    if (name == "matlab") return ExportFormat::matlab;
    if (name == "toml") return ExportFormat::toml;
    throw InputError(
        fmt::format("--export {}: the format must be kalibr, matlab or toml, the file stands behind it: "
                    "--export kalibr imu.yaml",
                    printable(name)));
}

std::string exported(ExportFormat format, const std::vector<AllanOutput>& series) {
    switch (format) {
        case ExportFormat::kalibr:
            check_series(series, "kalibr");
            return kalibr(series);
        case ExportFormat::matlab:
            check_series(series, "matlab");
            return matlab(series);
        case ExportFormat::toml:
            break;
    }
    check_series(series, "toml");
    return in_toml(series);
}

}  // namespace ringlock::app
