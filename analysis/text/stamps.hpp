#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

/// Time stamps, to the last digit that is written.
namespace ringlock::text {

/// Unit of time stamps.
struct TimeUnit {
    std::string name = "s";  ///< of --time-unit: s, ms, us, ns, mjd, iso; or min, h, d where a header declares these
    double seconds = 1.0;    ///< in one unit; 1 for ISO dates, which are kept in seconds since 1970
    bool iso = false;

    bool operator==(const TimeUnit&) const = default;
};

/// The unit of that name as --time-unit takes it. Throws InputError.
TimeUnit time_unit(const std::string& name);
inline constexpr std::string_view known_time_units = "s, ms, us, ns, mjd, iso";

/// The unit that a column of times declares, by its unit ("ns", "msec", "µs") or the end of its name ("time_us"); none
/// where it declares none that is known. `name` and `unit` as the header has them.
std::optional<TimeUnit> declared_time_unit(std::string_view name, std::string_view unit);

/// A time: the sum of a whole number and a part of one unit, so that 1403636579758555392 ns and 1403636579.758555392 s
/// lose nothing.
struct Stamp {
    std::int64_t whole = 0;
    double part = 0.0;  ///< NaN where the time is missing

    /// From a double, whose digits are all that is known.
    static Stamp of(double time);
    /// Units from `other` to this one.
    double since(const Stamp& other) const;
    double value() const { return static_cast<double>(whole) + part; }
};

/// A stamp as text: a number or, with `iso`, a date with or without a time of day (2024-05-01T12:00:00.5Z,
/// a blank for the T, an offset such as +02:00; without an offset it is taken for UTC). False where the text is no
/// stamp.
bool parse_stamp(std::string_view field, bool iso, bool decimal_comma, Stamp& stamp);

/// Whether a text looks like such a date.
bool is_iso_date(std::string_view field);

/// "12.5 s", "2024-05-01T12:00:00.5Z".
std::string text_of(const Stamp& stamp, const TimeUnit& unit);

}  // namespace ringlock::text
