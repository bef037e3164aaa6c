#pragma once
#include <functional>
#include <string_view>

/// What the user should know although nothing went wrong.
namespace ringlock {

/// Writes "ringlock: TEXT" and a newline to standard error, or hands the text to the sink that is set. What nobody can
/// read changes nothing. From any thread.
void notice(std::string_view text);

/// Takes notices in the place of standard error; an empty one gives them back to it.
void set_notice_sink(std::function<void(std::string_view text)> sink);

}  // namespace ringlock
