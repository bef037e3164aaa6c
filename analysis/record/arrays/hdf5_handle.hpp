#pragma once
#include <hdf5.h>

namespace ringlock::record {

/// Owns one HDF5 identifier.
class Handle {
   public:
    Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    ~Handle() {
        if (id_ >= 0) close_(id_);
    }
    operator hid_t() const { return id_; }
    bool valid() const { return id_ >= 0; }

   private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

}  // namespace ringlock::record
