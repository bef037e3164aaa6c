#pragma once
#include <cstddef>
#include <memory>
#include <string>

/// The bytes of a text file.
namespace ringlock::text {

/// Bytes, one after the other. A source that wraps another one owns it.
class Source {
   public:
    Source() = default;
    Source(const Source&) = delete;
    Source& operator=(const Source&) = delete;
    virtual ~Source() = default;

    /// Reads up to `size` bytes, at least one where there are more; 0 at the end. Throws InputError, naming the file,
    /// where it cannot be read, is damaged or ends too early, and Interrupted where the user asks to stop.
    virtual std::size_t read(char* to, std::size_t size) = 0;
};

/// A source whose first bytes have been looked at and come again.
class Peeked final : public Source {
   public:
    Peeked(std::unique_ptr<Source> from, std::size_t size);

    const std::string& first() const { return first_; }
    std::size_t read(char* to, std::size_t size) override;

   private:
    std::unique_ptr<Source> from_;
    std::string first_;
    std::size_t given_ = 0;
};

/// Opens a file, or standard input for "-", as text in UTF-8: unpacked where it is packed with gzip, xz or Zstandard,
/// in UTF-8 where it was in UTF-16, without a mark of the byte order. Throws InputError where it cannot be opened or is
/// of a kind that is no text (identify()).
std::unique_ptr<Source> open_text(const std::string& path);

/// The same for bytes of another source; `name` is their name in messages.
std::unique_ptr<Source> as_text(std::unique_ptr<Source> bytes, const std::string& name);

}  // namespace ringlock::text
