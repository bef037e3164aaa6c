#include "analysis/instrument/declare.hpp"

#include <optional>

namespace ringlock::instrument {

void declare(record::Declared& declared, const scenario::Scenario& model) {
    const auto fill = [](std::optional<double>& to, double value) {
        if (!to) to = value;
    };
    fill(declared.scale_factor_arcsec, model.gyro.scale_factor_arcsec);
    fill(declared.lockin_threshold_deg_h, model.gyro.lockin_threshold_deg_h);
    fill(declared.dither_frequency_hz, model.dither.frequency_hz);
    fill(declared.dither_peak_rate_deg_s, model.dither.peak_rate_deg_s);
}

}  // namespace ringlock::instrument
