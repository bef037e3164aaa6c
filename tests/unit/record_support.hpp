#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "analysis/record/record.hpp"
#include "engine/core/units.hpp"

/// Records made by hand.
namespace ringlock::test {

/// Turns of a plain dither: swings of 800 quarter fringes, 4 ms half cycles, a phase that drifts through all quarters.
inline record::Turns plain_turns(std::size_t rows, double noise_rad = 0.0, std::uint64_t seed = 1) {
    record::Turns turns;
    std::mt19937_64 engine(seed);
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < rows; ++i) {
        const bool minimum = i % 2 == 0;
        const double phase =
            0.3 + 0.7123 * static_cast<double>(i) + (minimum ? 0.0 : 400.0 * units::pi) + noise_rad * normal(engine);
        turns.time_s.push_back(0.25 + 0.004 * static_cast<double>(i));
        turns.direction.push_back(static_cast<std::int8_t>(minimum ? 1 : -1));
        turns.quarter_count.push_back(static_cast<std::int64_t>(std::floor(phase / (0.5 * units::pi))));
        turns.sine.push_back(2.0 * std::sin(phase));
        turns.cosine.push_back(2.0 * std::cos(phase));
        turns.accel_before_rad_s2.push_back(3.9e8);
        turns.accel_after_rad_s2.push_back(i == 3 ? 0.0 : 3.8e8);
    }
    return turns;
}

inline record::Samples plain_samples(std::size_t rows, record::SampleKind kind, std::uint64_t seed = 1) {
    record::Samples samples;
    std::mt19937_64 engine(seed);
    std::normal_distribution<double> normal;
    samples.rate_hz = 100.0;
    samples.t0_s = 0.5;
    samples.kind = kind;
    double angle = 0.0;
    for (std::size_t i = 0; i < rows; ++i) {
        const double gain = 0.15 + normal(engine);
        angle += gain;
        if (kind == record::SampleKind::quarter_count) {
            samples.counts.push_back(static_cast<std::int64_t>(std::floor(8.0 * angle)));
        } else {
            samples.values.push_back(kind == record::SampleKind::angle_arcsec ? angle : gain);
        }
    }
    return samples;
}

/// A record that holds everything.
inline record::Record full_record() {
    record::Record r;
    r.title = "bench";
    r.instrument = "ring, 28 cm";
    r.source = "test \xC3\xA9t\xC3\xA9";
    r.licence = "CC0";
    r.declared = {0.5, 300.0, 125.0, 109.0, -0.01, 1e8, 0.005, 15.0};
    r.turns = plain_turns(50);
    r.samples = plain_samples(40, record::SampleKind::angle_increment_arcsec);
    for (const char* name : {"accel_x", "accel_y", "accel_z", "temperature_c"}) {
        r.samples->witnesses[name] = plain_samples(40, record::SampleKind::angle_increment_arcsec, 7).values;
    }
    r.reader = record::DeclaredReader{};
    r.temperature_c = {{0.0, 0.3, 1.0}, {20.0, 20.5, 21.0}};
    r.input_rate_deg_h = {{0.0, 1.0}, {15.0, 16.0}};
    return r;
}

inline void expect_equal(const record::Record& a, const record::Record& b) {
    EXPECT_EQ(a.title, b.title);
    EXPECT_EQ(a.instrument, b.instrument);
    EXPECT_EQ(a.source, b.source);
    EXPECT_EQ(a.licence, b.licence);
    EXPECT_EQ(a.declared.scale_factor_arcsec, b.declared.scale_factor_arcsec);
    EXPECT_EQ(a.declared.lockin_threshold_deg_h, b.declared.lockin_threshold_deg_h);
    EXPECT_EQ(a.declared.dither_frequency_hz, b.declared.dither_frequency_hz);
    EXPECT_EQ(a.declared.dither_peak_rate_deg_s, b.declared.dither_peak_rate_deg_s);
    EXPECT_EQ(a.declared.bias_deg_h, b.declared.bias_deg_h);
    EXPECT_EQ(a.declared.clock_hz, b.declared.clock_hz);
    EXPECT_EQ(a.declared.readout_noise_rad, b.declared.readout_noise_rad);
    EXPECT_EQ(a.declared.input_rate_deg_h, b.declared.input_rate_deg_h);
    ASSERT_EQ(a.turns.has_value(), b.turns.has_value());
    if (a.turns) {
        EXPECT_EQ(a.turns->time_s, b.turns->time_s);
        EXPECT_EQ(a.turns->direction, b.turns->direction);
        EXPECT_EQ(a.turns->quarter_count, b.turns->quarter_count);
        EXPECT_EQ(a.turns->sine, b.turns->sine);
        EXPECT_EQ(a.turns->cosine, b.turns->cosine);
        EXPECT_EQ(a.turns->accel_before_rad_s2, b.turns->accel_before_rad_s2);
        EXPECT_EQ(a.turns->accel_after_rad_s2, b.turns->accel_after_rad_s2);
    }
    ASSERT_EQ(a.samples.has_value(), b.samples.has_value());
    if (a.samples) {
        EXPECT_EQ(a.samples->rate_hz, b.samples->rate_hz);
        EXPECT_EQ(a.samples->t0_s, b.samples->t0_s);
        EXPECT_EQ(a.samples->kind, b.samples->kind);
        EXPECT_EQ(a.samples->values, b.samples->values);
        EXPECT_EQ(a.samples->counts, b.samples->counts);
        EXPECT_EQ(a.samples->witnesses, b.samples->witnesses);
    }
    EXPECT_EQ(a.temperature_c.time_s, b.temperature_c.time_s);
    EXPECT_EQ(a.temperature_c.value, b.temperature_c.value);
    EXPECT_EQ(a.input_rate_deg_h.time_s, b.input_rate_deg_h.time_s);
    EXPECT_EQ(a.input_rate_deg_h.value, b.input_rate_deg_h.value);
}

inline std::string file_bytes(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace ringlock::test
