#include "analysis/export/numpy.hpp"

#include <archive.h>
#include <archive_entry.h>
#include <fmt/format.h>

#include <algorithm>
#include <concepts>
#include <memory>
#include <string_view>

#include "analysis/export/unicode.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::exports {
namespace {

template <class T>
constexpr const char* numpy_type() {
    if constexpr (std::same_as<T, double>) return "<f8";
    if constexpr (std::same_as<T, std::int64_t>) return "<i8";
    if constexpr (std::same_as<T, std::uint64_t>) return "<u8";
    if constexpr (std::same_as<T, std::int8_t>) return "|i1";
}

/// The head of an array by version 1.0 of NumPy's format (numpy.lib.format): its length is a multiple of 64.
std::string numpy_head(const std::string& type, const std::vector<std::uint64_t>& shape) {
    std::string sides;
    for (const std::uint64_t side : shape) sides += fmt::format("{}, ", side);
    if (shape.size() > 1) sides.resize(sides.size() - 2);
    if (shape.size() == 1) sides.pop_back();
    std::string text = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", type, sides);
    constexpr std::size_t before = 10;  // magic string, version, length
    constexpr std::size_t alignment = 64;
    while ((before + text.size() + 1) % alignment != 0) text += ' ';
    text += '\n';
    std::string head("\x93NUMPY\x01\x00", 8);
    head += static_cast<char>(text.size() & 0xff);
    head += static_cast<char>(text.size() >> 8);
    return head + text;
}

class Npz {
   public:
    Npz(int descriptor, std::string shown_as)
        : archive_(archive_write_new(), archive_write_free), shown_as_(std::move(shown_as)) {
        require(archive_ ? ARCHIVE_OK : ARCHIVE_FATAL);
        require(archive_write_set_format_zip(archive_.get()));
        require(archive_write_set_format_option(archive_.get(), "zip", "compression", "store"));
        // Without padding to the blocks of tapes.
        require(archive_write_set_bytes_per_block(archive_.get(), 1 << 16));
        require(archive_write_set_bytes_in_last_block(archive_.get(), 1));
        require(archive_write_open_fd(archive_.get(), descriptor));
    }

    void begin(const std::string& name, const std::string& type, const std::vector<std::uint64_t>& shape,
               std::uint64_t bytes) {
        const std::string head = numpy_head(type, shape);
        const std::unique_ptr<archive_entry, void (*)(archive_entry*)> entry(archive_entry_new(), archive_entry_free);
        archive_entry_set_pathname_utf8(entry.get(), (name + ".npy").c_str());
        archive_entry_set_filetype(entry.get(), AE_IFREG);
        archive_entry_set_perm(entry.get(), 0644);
        archive_entry_set_size(entry.get(), static_cast<la_int64_t>(head.size() + bytes));
        constexpr std::time_t first_of_zip = 315532800;  // 1980-01-01, so that equal data make equal bytes
        archive_entry_set_mtime(entry.get(), first_of_zip, 0);
        require(archive_write_header(archive_.get(), entry.get()));
        put(head.data(), head.size());
    }
    void put(const void* data, std::size_t size) {
        const char* at = static_cast<const char*>(data);
        while (size > 0) {
            const la_ssize_t written = archive_write_data(archive_.get(), at, size);
            if (written <= 0) fail();
            at += written;
            size -= static_cast<std::size_t>(written);
        }
    }
    void close() { require(archive_write_close(archive_.get())); }

    template <class T>
    void add(const std::string& name, const std::vector<T>& values, const std::vector<std::uint64_t>& shape) {
        if constexpr (std::same_as<T, std::string>) {
            std::vector<std::u32string> texts;
            std::size_t longest = 1;  // NumPy knows no text of no characters
            for (const std::string& value : values) {
                texts.push_back(code_points(value));
                longest = std::max(longest, texts.back().size());
            }
            begin(name, fmt::format("<U{}", longest), shape, longest * sizeof(char32_t) * texts.size());
            for (std::u32string& text : texts) {
                text.resize(longest, U'\0');
                put(text.data(), longest * sizeof(char32_t));
            }
        } else {
            begin(name, numpy_type<T>(), shape, values.size() * sizeof(T));
            put(values.data(), values.size() * sizeof(T));
        }
    }

   private:
    void require(int status) {
        if (status < ARCHIVE_WARN) fail();
    }
    [[noreturn]] void fail() {
        const char* why = archive_ ? archive_error_string(archive_.get()) : nullptr;
        throw RunError(fmt::format("{}: cannot be written: {}; is the disk full?", printable(shown_as_),
                                   printable(std::string(why != nullptr ? why : "no reason given"))));
    }

    std::unique_ptr<archive, int (*)(archive*)> archive_;
    std::string shown_as_;
};

template <class T>
void add_dataset(Npz& npz, const store::File& file, const store::ListedObject& dataset, const std::string& name) {
    if constexpr (std::same_as<T, std::string>) {
        npz.add(name, std::get<std::vector<std::string>>(store::read_values(file, dataset)), dataset.shape);
    } else {
        npz.begin(name, numpy_type<T>(), dataset.shape, dataset.size() * sizeof(T));
        each_block(file, dataset, [&](const store::Values& values, auto, auto) {
            const auto& block = std::get<std::vector<T>>(values);
            npz.put(block.data(), block.size() * sizeof(T));
        });
    }
}

void add_dataset_of_kind(Npz& npz, const store::File& file, const store::ListedObject& dataset) {
    const std::string name = dataset.path.substr(1);
    switch (dataset.kind) {
        case store::ElementKind::text:
            return add_dataset<std::string>(npz, file, dataset, name);
        case store::ElementKind::real:
            return add_dataset<double>(npz, file, dataset, name);
        case store::ElementKind::integer:
            return add_dataset<std::int64_t>(npz, file, dataset, name);
        case store::ElementKind::unsigned_integer:
            return add_dataset<std::uint64_t>(npz, file, dataset, name);
        case store::ElementKind::small_integer:
            return add_dataset<std::int8_t>(npz, file, dataset, name);
    }
}

void add_attribute(Npz& npz, const std::string& name, const store::AttributeValue& value) {
    std::visit(
        [&]<class T>(const T& v) {
            if constexpr (std::same_as<T, std::vector<double>>) {
                npz.add(name, v, {v.size()});
            } else {
                npz.add(name, std::vector<T>{v}, {});
            }
        },
        value);
}

}  // namespace

void write_npz(const store::File& file, const std::vector<store::ListedObject>& objects, int descriptor,
               const std::string& shown_as) {
    Npz npz(descriptor, shown_as);
    std::vector<std::string> labels;
    for (const store::ListedObject& object : objects) {
        const std::string name = object.path.substr(1);
        for (const store::ListedAttribute& attribute : object.attributes) {
            add_attribute(npz, fmt::format("{}@{}", name, attribute.name), attribute.value);
        }
        if (!object.is_dataset) continue;
        add_dataset_of_kind(npz, file, object);
        labels.insert(labels.end(), {name, object.unit, object.description});
    }
    npz.add("labels", labels, {labels.size() / 3, 3});
    npz.close();
}

}  // namespace ringlock::exports
