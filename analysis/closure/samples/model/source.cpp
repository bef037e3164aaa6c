#include "analysis/closure/samples/model/source.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "analysis/closure/options.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Differences of angles at the ends of the record's intervals, on the straight lines between the source's readings.
template <std::size_t N, class Readings>
std::array<std::vector<double>, N> between_readings(const SampleSource& source, std::size_t size, double interval_s,
                                                    const Readings& readings) {
    const double ratio = source.from_hz * interval_s;
    std::array<std::vector<double>, N> taken;
    taken.fill(std::vector<double>(size));
    double tick = std::floor(source.from_phase);
    std::array<double, N> from = readings(tick);
    std::array<double, N> to = readings(tick + 1.0);
    std::array<double, N> before{};
    for (std::size_t i = 0; i <= size; ++i) {
        const double place = source.from_phase + ratio * static_cast<double>(i);
        if (const double at = std::floor(place); at != tick) {
            from = at == tick + 1.0 ? to : readings(at);
            to = readings(at + 1.0);
            tick = at;
        }
        for (std::size_t k = 0; k < N; ++k) {
            const double now = from[k] + (place - tick) * (to[k] - from[k]);
            if (i > 0) taken[k][i - 1] = now - before[k];
            before[k] = now;
        }
    }
    return taken;
}

struct Clock {
    double start, period;
};

/// Clock with about that period that ticks at all these times, and possibly at others; no value if there is none.
std::optional<Clock> clock_of(const std::vector<double>& times, double period) {
    const double exact = options.samples.record.off_clock;
    double start = times.front();
    double number = 0.0;
    double count = 0.0, sum_k = 0.0, sum_t = 0.0, sum_kk = 0.0, sum_kt = 0.0;
    for (std::size_t j = 0; j < times.size(); ++j) {
        if (j > 0) number += std::round((times[j] - times[j - 1]) / period);
        const double t = times[j] - times.front();
        count += 1.0;
        sum_k += number;
        sum_t += t;
        sum_kk += number * number;
        sum_kt += number * t;
        const double spread = sum_kk - sum_k * sum_k / count;
        if (!(spread > 0.0)) continue;
        period = (sum_kt - sum_k * sum_t / count) / spread;
        start = times.front() + (sum_t - period * sum_k) / count;
    }
    double squares = 0.0;
    for (const double time : times) squares += std::pow(std::remainder(time - start, period), 2);
    if (!(squares < exact * exact * count)) return std::nullopt;
    return Clock{start, period};
}

}  // namespace

bool same_source(double one_hz, double other_hz, double rate_hz) {
    return std::abs(one_hz - other_hz) < options.samples.contest.same_source * rate_hz;
}

std::vector<SamePattern> with_same_pattern(double from_hz, double rate_hz) {
    const SampleScreenOptions& by = options.samples.screen;
    std::vector<SamePattern> all{{from_hz, 1.0}};
    for (int multiple = -by.most_multiple; multiple <= 2 * by.most_multiple; ++multiple) {
        for (const double sign : {1.0, -1.0}) {
            const double hz = sign * from_hz + multiple * rate_hz;
            if (hz < by.slowest_source * rate_hz || hz > by.fastest_source * rate_hz) continue;
            const bool known = std::any_of(
                all.begin(), all.end(), [&](const SamePattern& other) { return same_source(hz, other.hz, rate_hz); });
            if (!known) all.push_back({hz, sign});
        }
    }
    return all;
}

double phase_of(const SamePattern& pattern, double from_phase) {
    return pattern.sign * from_phase - std::floor(pattern.sign * from_phase);
}

std::optional<SampleSource> find_straight_lines(const std::vector<double>& increments, double rate_hz) {
    const SampleRecordOptions& record = options.samples.record;
    const auto [low, high] = std::minmax_element(increments.begin(), increments.end());
    const double tolerance = record.same_line * (*high - *low);
    const auto line_goes_on = [&](std::size_t i) { return std::abs(increments[i] - increments[i - 1]) <= tolerance; };
    // Times of readings, in intervals of the record, where one interval lies between two lines.
    std::vector<double> turns;
    for (std::size_t i = 2; i + 2 < increments.size(); ++i) {
        if (!line_goes_on(i - 1) || line_goes_on(i) || line_goes_on(i + 1) || !line_goes_on(i + 2)) continue;
        const double before = increments[i - 1];
        const double after = increments[i + 1];
        const double share = (increments[i] - after) / (before - after);
        if (share > 0.0 && share < 1.0) turns.push_back(static_cast<double>(i) + share);
    }
    if (turns.size() < record.fewest_readings) return std::nullopt;
    std::vector<double> apart;
    for (std::size_t k = 1; k < turns.size(); ++k) apart.push_back(turns[k] - turns[k - 1]);
    // The shortest distance, except for some by chance, is one interval of the source, or a few of them if few readings
    // are found.
    const auto shortest = apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 20);
    std::nth_element(apart.begin(), shortest, apart.end());
    for (double some = 1.0; *shortest / some >= record.shortest_source_interval; some += 1.0) {
        if (const auto clock = clock_of(turns, *shortest / some)) {
            const double phase = -clock->start / clock->period;
            return SampleSource{rate_hz / clock->period, phase - std::floor(phase)};
        }
    }
    return std::nullopt;
}

std::vector<double> as_taken(const SampleSource& source, const std::vector<double>& increments, double interval_s) {
    if (!(source.from_hz > 0.0)) return increments;
    const std::size_t n = increments.size();
    std::vector<double> angle(n + 1, 0.0);
    for (std::size_t i = 0; i < n; ++i) angle[i + 1] = angle[i] + increments[i];
    const double ratio = source.from_hz * interval_s;
    auto taken = between_readings<1>(source, n, interval_s, [&](double tick) {
        const double row = (tick - source.from_phase) / ratio;
        const auto i = static_cast<std::size_t>(std::clamp(row, 0.0, static_cast<double>(n - 1)));
        return std::array{angle[i] + (row - static_cast<double>(i)) * (angle[i + 1] - angle[i])};
    });
    return std::move(taken[0]);
}

std::vector<std::vector<double>> line_columns(std::size_t size, double rate_hz, const FrequencyTrack& track) {
    const auto phase = line_phase(size, rate_hz, track);
    std::vector<std::vector<double>> columns(2, std::vector<double>(size));
    for (std::size_t i = 0; i < size; ++i) {
        columns[0][i] = std::cos(phase[i]);
        columns[1][i] = std::sin(phase[i]);
    }
    return columns;
}

std::vector<std::vector<double>> line_as_taken(const SampleSource& source, std::size_t size, double rate_hz,
                                               const FrequencyTrack& track) {
    if (!(source.from_hz > 0.0)) return line_columns(size, rate_hz, track);
    // An angle of sin(phase)/(2 sin(pi f/rate)) has increments of cos(phase).
    const double gain = 2.0 * std::sin(units::pi * track.hz / rate_hz);
    auto taken = between_readings<2>(source, size, 1.0 / rate_hz, [&](double tick) {
        const double t = (tick - source.from_phase) / source.from_hz - 0.5 * static_cast<double>(size) / rate_hz;
        const double turns = track.turns(t);
        const double phase = units::two_pi * (turns - std::floor(turns));
        return std::array{std::sin(phase) / gain, -std::cos(phase) / gain};
    });
    return {std::move(taken[0]), std::move(taken[1])};
}

Alias alias(double hz, double rate_hz) {
    const double off = hz - std::round(hz / rate_hz) * rate_hz;
    return {std::abs(off), off < 0.0};
}

Alias alias(double hz, double rate_hz, double from_hz) {
    if (!(from_hz > 0.0)) return alias(hz, rate_hz);
    const Alias read = alias(hz, from_hz);
    const Alias seen = alias(read.hz, rate_hz);
    return {seen.hz, read.folded != seen.folded};
}

std::vector<Alias> of_source(double shown_hz, double rate_hz, double from_hz) {
    if (!(from_hz > 0.0)) return {{shown_hz, false}};
    std::vector<Alias> all;
    for (int m = 0; m * rate_hz <= 0.5 * from_hz + shown_hz; ++m) {
        for (const int sign : {-1, 1}) {
            const double hz = m * rate_hz + sign * shown_hz;
            if (hz > 0.0 && hz <= 0.5 * from_hz) all.push_back({hz, sign < 0});
        }
    }
    // A source slower than the record shows a line above half of its rate as well, with less power.
    if (all.empty()) all.push_back(alias(shown_hz, from_hz));
    return all;
}

}  // namespace ringlock::closure
