#include "engine/reader/stripper.hpp"

#include <algorithm>
#include <cmath>

#include "engine/reader/no_stripping.hpp"
#include "engine/reader/notch.hpp"
#include "engine/reader/reference_fir.hpp"
#include "engine/reader/whole_cycle.hpp"

namespace ringlock::reader {

std::unique_ptr<Stripper> make_stripper(const Settings& settings, double latch_hz, double dither_hz) {
    const auto fir = [&] {
        const double cutoff_hz = settings.fir_cutoff_hz > 0.0 ? settings.fir_cutoff_hz : 0.25 * dither_hz;
        // The transition band of Hamming's window extends to two over the filter's length beyond the cut-off: with four
        // cycles of the dither that is half of the dither's frequency.
        const auto order = settings.fir_order > 0 ? static_cast<std::size_t>(settings.fir_order)
                                                  : 2 * static_cast<std::size_t>(std::ceil(2.0 * latch_hz / dither_hz));
        return Fir(order, cutoff_hz, latch_hz, dither_hz);
    };
    switch (settings.stripping) {
        case Stripping::none:
            break;
        case Stripping::whole_cycle:
            return std::make_unique<WholeCycle>(dither_hz);
        case Stripping::reference:
            return std::make_unique<Reference>(settings, latch_hz, dither_hz);
        case Stripping::fir:
            return std::make_unique<Fir>(fir());
        case Stripping::notch:
            return std::make_unique<Notch>(settings.notch_bandwidth_hz, latch_hz, dither_hz);
        case Stripping::reference_fir:
            return std::make_unique<ReferenceFir>(Reference(settings, latch_hz, dither_hz), fir());
    }
    return std::make_unique<NoStripping>();
}

std::int64_t warm_up_outputs(const Stripper& stripper, double output_hz) {
    constexpr double most = 1e15;
    return static_cast<std::int64_t>(std::min(most, std::ceil(stripper.warm_up_s() * output_hz)));
}

}  // namespace ringlock::reader
