#pragma once
#include <string>

#include "analysis/record/record.hpp"

namespace ringlock::app {

/// One line that summarises the content of a record.
std::string record_text(const record::Record& record);

/// Writes the warnings of a record: findings that are not errors.
void tell_warnings(const std::string& path, const record::Record& record);

}  // namespace ringlock::app
