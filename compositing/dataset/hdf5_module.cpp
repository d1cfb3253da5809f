#include "compositing/dataset/hdf5_module.h"

#include <hdf5.h>

namespace glasswing {
namespace {

// Closes an object of HDF5; a negative id is none.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  hid_t id() const { return id_; }
  bool ok() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

bool write(hid_t file, const Hdf5Dataset& dataset) {
  const Handle groups(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  if (!groups.ok() || H5Pset_create_intermediate_group(groups.id(), 1) < 0) return false;
  const Handle space(dataset.shape.empty()
                         ? H5Screate(H5S_SCALAR)
                         : H5Screate_simple(static_cast<int>(dataset.shape.size()),
                                            reinterpret_cast<const hsize_t*>(dataset.shape.data()), nullptr),
                     H5Sclose);
  const auto put = [&](hid_t stored, hid_t given, const void* values) {
    const Handle made(
        H5Dcreate2(file, dataset.name.c_str(), stored, space.id(), groups.id(), H5P_DEFAULT, H5P_DEFAULT),
        H5Dclose);
    return made.ok() && H5Dwrite(made.id(), given, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0;
  };
  if (const auto* doubles = std::get_if<std::vector<double>>(&dataset.value))
    return put(H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, doubles->data());
  if (const auto* floats = std::get_if<std::vector<float>>(&dataset.value))
    return put(H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, floats->data());
  // As h5py stores str: of variable length, UTF-8.
  const Handle text(H5Tcopy(H5T_C_S1), H5Tclose);
  if (!text.ok() || H5Tset_size(text.id(), H5T_VARIABLE) < 0 || H5Tset_cset(text.id(), H5T_CSET_UTF8) < 0)
    return false;
  const char* const letters = std::get<std::string>(dataset.value).c_str();
  return put(text.id(), text.id(), static_cast<const void*>(&letters));
}

}  // namespace
}  // namespace glasswing

extern "C" const glasswing::Hdf5Module glasswing_hdf5_module;
const glasswing::Hdf5Module glasswing_hdf5_module{
    .write = [](const std::string& path, std::span<const glasswing::Hdf5Dataset> datasets) {
      using namespace glasswing;
      H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // or it writes to the terminal
      const Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
      if (!file.ok()) return false;
      for (const Hdf5Dataset& dataset : datasets) {
        if (!write(file.id(), dataset)) return false;
      }
      return H5Fflush(file.id(), H5F_SCOPE_GLOBAL) >= 0;
    }};
