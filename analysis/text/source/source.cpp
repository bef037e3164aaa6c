#include "analysis/text/source/source.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "analysis/text/source/identify.hpp"
#include "analysis/text/source/unpack.hpp"
#include "analysis/text/source/utf16.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/waiting.hpp"

namespace ringlock::text {
namespace {

constexpr std::size_t first_bytes = 4096;

class File final : public Source {
   public:
    explicit File(const std::string& path) : name_(name_of_file(path)) {
        if (path == standard_input) return;
        file_ = open_to_read(path);
        if (!file_.valid()) throw InputError(fmt::format("{}: cannot be opened: {}", name_, std::strerror(errno)));
        descriptor_ = file_.get();
    }

    std::size_t read(char* to, std::size_t size) override {
        const ssize_t got = read_some(descriptor_, to, size);
        if (got < 0) throw InputError(fmt::format("{}: cannot be read: {}", name_, std::strerror(errno)));
        return static_cast<std::size_t>(got);
    }

   private:
    std::string name_;
    Descriptor file_;
    int descriptor_ = STDIN_FILENO;
};

void refuse(const Identity& identity, const std::string& name, bool unpacked) {
    if (identity.kind.empty()) return;
    throw InputError(
        fmt::format("{}: {}is {}; {}", name, unpacked ? "its unpacked content " : "", identity.kind, identity.advice));
}

}  // namespace

Peeked::Peeked(std::unique_ptr<Source> from, std::size_t size) : from_(std::move(from)), first_(size, '\0') {
    std::size_t filled = 0;
    while (filled < size) {
        const std::size_t got = from_->read(first_.data() + filled, size - filled);
        if (got == 0) break;
        filled += got;
    }
    first_.resize(filled);
}

std::size_t Peeked::read(char* to, std::size_t size) {
    if (given_ == first_.size()) return from_->read(to, size);
    const std::size_t count = std::min(size, first_.size() - given_);
    std::memcpy(to, first_.data() + given_, count);
    given_ += count;
    return count;
}

std::unique_ptr<Source> as_text(std::unique_ptr<Source> bytes, const std::string& name) {
    auto peeked = std::make_unique<Peeked>(std::move(bytes), first_bytes);
    bool unpacked = false;
    if (const Packing packing = packing_of(peeked->first()); packing != Packing::none) {
        peeked = std::make_unique<Peeked>(unpack(std::move(peeked), packing, name), first_bytes);
        unpacked = true;
    }
    const Identity identity = identify(peeked->first());
    refuse(identity, name, unpacked);
    const Encoding encoding = encoding_of(peeked->first());
    if (encoding == Encoding::bytes) return peeked;
    return decode(std::move(peeked), encoding, name);
}

std::unique_ptr<Source> open_text(const std::string& path) {
    return as_text(std::make_unique<File>(path), name_of_file(path));
}

}  // namespace ringlock::text
