#pragma once
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "engine/core/atomic_path.hpp"

namespace ringlock::app {

/// Keeps the command line, whose words may hold newlines, so that put() and tell() show these as "\x0a".
void remember_arguments(std::span<const char* const> arguments);

/// Writes to standard output, at once; characters that would control a terminal are escaped, see printable(). Throws
/// RunError where it cannot be written (a full disk, say): results that nobody can read are no success. Throws
/// Interrupted where the user asks to stop while it is written.
void put(std::string_view text);

/// Writes information for people to standard error, escaped likewise. A failure to write it does not change the run.
void tell(std::string_view text);

/// A message for standard error whose "error:" or "warning:" at the beginning has a colour, where that is a terminal
/// and the environment does not refuse colours by NO_COLOR. Everything else in it has been escaped before.
std::string coloured(std::string message);

/// Writes to standard error a text that controls the terminal: a line that is drawn anew. Foreign text in it has gone
/// through printable().
void draw_over(std::string_view text);

/// Claims the figure of --plot, so that it is known before a run, not after it, that it cannot be written; null for an
/// empty path. It must end in .svg, .png or .pdf: a figure replaces the file it finds. Throws InputError.
std::unique_ptr<AtomicPath> claim_figure(const std::filesystem::path& path);

/// Opens standard streams that the caller has closed (on nothing), so that no other file gets their descriptors and
/// receives the messages.
void hold_standard_streams();

}  // namespace ringlock::app
