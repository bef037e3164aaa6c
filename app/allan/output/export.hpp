#pragma once
#include <string>
#include <vector>

#include "app/allan/output/allan_output.hpp"

namespace ringlock::app {

/// Programs whose files the coefficients can be written as.
enum class ExportFormat {
    kalibr,  ///< imu.yaml of Kalibr: noise density and random walk, the largest of the axes
    matlab,  ///< a script with gyroparams() or accelparams(), each axis by itself
    toml     ///< all coefficients of all series in our units and in those of the SI
};

/// Throws InputError where the name is not known.
ExportFormat export_format(const std::string& name);

/// The coefficients as text of that format. A coefficient that is not resolved is a comment with its limit.
///
/// Units: docs/units.md derives them. N and K of Kalibr and MATLAB are densities of the two-sided spectrum, per
/// sqrt(Hz), in rad/s or m/s^2.
///
/// Throws InputError where the format has no place for the instrument or for so many axes, no unit was given, or the
/// coefficients of a series are withheld.
std::string exported(ExportFormat format, const std::vector<AllanOutput>& series);

}  // namespace ringlock::app
