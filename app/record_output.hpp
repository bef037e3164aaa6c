#pragma once
#include <string>

#include "analysis/record/record.hpp"

namespace ringlock::app {

/// One line: what a record holds.
std::string record_text(const record::Record& record);

/// Tells what is strange about a record and no error.
void tell_warnings(const std::string& path, const record::Record& record);

}  // namespace ringlock::app
