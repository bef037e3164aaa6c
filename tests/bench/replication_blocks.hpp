#pragma once
#include <cstdint>
#include <random>

#include "tests/support/replication.hpp"

/// The blocks of results/replication/tables.md; each prints its tables to standard output.
namespace ringlock::bench::replication {

namespace rp = ringlock::test::replication;
using rp::Span;

/// Rates that what is cited of the paper implies or suggests, see the page.
inline constexpr double rates_deg_h[] = {15.0, 100.0, 200.0, 300.0, 400.0};
inline constexpr double tolerance_rad = 1e-10;

class Uniform {
   public:
    explicit Uniform(std::uint64_t seed) : engine_(seed) {}
    double operator()(double low, double high) {
        return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
    }

   private:
    std::mt19937_64 engine_;
};

// The device, its turns and what they add up to (replication_device.cpp):
void device();
void half_turns();
void turns();
void averaging();
void cycles();

// Readings of whole counts (replication_readings.cpp):
void readings();
void implied();
void table_1();

// Corrections of one cycle (replication_corrections.cpp):
void corrections();
void likelihood();
void search();
void one_cycle();

/// Of a result of scenarios/gao-deng-2007-coefficients.toml (replication_coefficients.cpp).
void coefficients(const char* file);

}  // namespace ringlock::bench::replication
