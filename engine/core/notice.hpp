#pragma once
#include <functional>
#include <string_view>

/// Notices: information for the user although nothing went wrong.
namespace ringlock {

/// Writes "ringlock: TEXT" and a newline to standard error, or hands the text to the sink that is set. A failure to
/// write it is ignored. From any thread.
void notice(std::string_view text);

/// Takes notices in the place of standard error; an empty one gives them back to it.
void set_notice_sink(std::function<void(std::string_view text)> sink);

}  // namespace ringlock
