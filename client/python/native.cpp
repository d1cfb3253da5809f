// The C++ part of the Python package: matte files, compositing, and picture files. glasswing/_native.pyi has
// the types; only the package calls this module, and it checks shapes before.
//
// Messages cross as bytes, never as objects, so that python3-protobuf and this module share only Debian's
// libprotobuf, whose descriptor pool works in whatever order they are loaded.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/frame/image.h"
#include "core/frame/image_file.h"
#include "core/matte/compositor.h"
#include "core/matte/fast_compositor.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace py = pybind11;
using Floats = py::array_t<float, py::array::c_style>;

struct StatusError {
  absl::Status status;
};

template <typename Value>
Value value_of(absl::StatusOr<Value> result) {
  if (!result.ok()) throw StatusError{result.status()};
  return *std::move(result);
}

// Runs `work` without the GIL and returns its result.
template <typename Work>
auto without_gil(Work work) {
  const py::gil_scoped_release released;
  return work();
}

void raise(const absl::Status& status) {
  const py::object error =
      py::module_::import("glasswing.errors")
          .attr("error_of")(absl::StatusCodeToString(status.code()), std::string(status.message()));
  PyErr_SetObject(py::type::of(error).ptr(), error.ptr());
}

RadianceImage image_of(const Floats& picture) {
  RadianceImage image(static_cast<int>(picture.shape(1)), static_cast<int>(picture.shape(0)));
  std::copy_n(picture.data(), picture.size(), image.samples.begin());
  return image;
}

Floats array_of(RadianceImage image) {
  const py::ssize_t height = image.height_px, width = image.width_px;
  auto owned = std::make_unique<std::vector<float>>(std::move(image.samples));
  float* const first = owned->data();
  const py::capsule owner(owned.release(),
                          [](void* samples) { delete static_cast<std::vector<float>*>(samples); });
  return Floats({height, width, py::ssize_t{kChannels}}, first, owner);
}

Floats mapped(const Floats& values, float (*function)(float)) {
  Floats results(std::vector<py::ssize_t>(values.shape(), values.shape() + values.ndim()));
  const float* const from = values.data();
  float* const to = results.mutable_data();
  const py::ssize_t count = values.size();
  without_gil([=] { return std::transform(from, from + count, to, function); });
  return results;
}

// An immutable matte, so that arrays can view it and threads can composite it concurrently.
class NativeMatte {
 public:
  explicit NativeMatte(Matte matte) : matte_(std::move(matte)) {}

  // Not const, since a const Matte returns pixels by value.
  Matte& matte() { return matte_; }

  // `thread_count`: 0 uses all cores; the result does not depend on it.
  RadianceImage composite(std::vector<RadianceImage> backgrounds, bool exact, int thread_count) const {
    for (size_t t = 0; t < backgrounds.size(); ++t) {
      if (backgrounds[t].empty()) continue;
      const v1::Monitor& monitor = matte_.metadata.monitors(static_cast<int>(t));
      backgrounds[t] = resized(backgrounds[t], monitor.width_px(), monitor.height_px());
    }
    if (exact) return value_of(glasswing::composite(matte_, backgrounds, thread_count));
    return value_of(prepared(thread_count).composite(backgrounds, thread_count));
  }

 private:
  const FastCompositor& prepared(int thread_count) const {
    const std::lock_guard lock(mutex_);
    if (!prepared_) prepared_ = value_of(FastCompositor::create(matte_, thread_count));
    return *prepared_;
  }

  Matte matte_;
  mutable std::mutex mutex_;
  mutable std::optional<FastCompositor> prepared_;
};

Matte& matte_of(const py::object& self) {
  return self.cast<NativeMatte&>().matte();
}

// A read-only view into `self`, which it keeps alive.
template <typename Value>
py::array view(const py::object& self, const Value& first, std::vector<py::ssize_t> shape,
               std::vector<py::ssize_t> strides) {
  py::array array(py::dtype::of<Value>(), std::move(shape), std::move(strides), &first, self);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

// One value per pixel: height x width.
template <typename Value>
py::array of_pixels(const py::object& self, const Value& first) {
  const Matte& matte = matte_of(self);
  const py::ssize_t size = sizeof(Value);
  return view(self, first, {matte.height_px(), matte.width_px()}, {matte.width_px() * size, size});
}

py::array foreground_of(const py::object& self) {
  Matte& matte = matte_of(self);
  const py::ssize_t size = sizeof(float), pixel = kChannels * size;
  return view(self, matte.foreground(0, 0).front(), {matte.height_px(), matte.width_px(), kChannels},
              {matte.width_px() * pixel, pixel, size});
}

// One number per mode: height x width x 3 x modes. The channels of a colourless matte share one memory.
template <typename Value>
py::array of_modes(const py::object& self, Value Mode::*number) {
  const Matte& matte = matte_of(self);
  const py::ssize_t modes = matte.modes_per_channel(), channels = matte.is_colourless() ? 1 : kChannels;
  const py::ssize_t mode = sizeof(Mode), channel = modes * mode, pixel = channels * channel;
  return view(self, matte.modes(0, 0, 0).front().*number,
              {matte.height_px(), matte.width_px(), kChannels, modes},
              {matte.width_px() * pixel, pixel, matte.is_colourless() ? 0 : channel, mode});
}

// `pictures`: one background for each of the matte's monitors; None is black.
Floats composite(const NativeMatte& matte, const std::vector<std::optional<Floats>>& pictures, bool exact,
                 int thread_count) {
  std::vector<RadianceImage> backgrounds;
  for (const std::optional<Floats>& picture : pictures) {
    backgrounds.push_back(picture ? image_of(*picture) : RadianceImage());
  }
  return array_of(without_gil([&] { return matte.composite(std::move(backgrounds), exact, thread_count); }));
}

void bind_matte(py::module_& module) {
  py::class_<NativeMatte> matte(module, "NativeMatte");
  matte.def_static("read", [](const std::string& path) {
    return std::make_unique<NativeMatte>(without_gil([&] { return value_of(read_matte(path)); }));
  });
  matte.def_static("decode", [](std::string_view bytes) {
    return std::make_unique<NativeMatte>(without_gil([&] { return value_of(decode_matte(bytes)); }));
  });
  matte.def_property_readonly(
      "metadata", [](NativeMatte& self) { return py::bytes(self.matte().metadata.SerializeAsString()); });
  matte.def_property_readonly("foreground", &foreground_of);
  matte.def_property_readonly(
      "coverage", [](const py::object& self) { return of_pixels(self, matte_of(self).coverage(0, 0)); });
  matte.def_property_readonly(
      "flags", [](const py::object& self) { return of_pixels(self, matte_of(self).flags(0, 0)); });
  const auto def_modes = [&matte](const char* name, auto number) {
    matte.def_property_readonly(name, [number](const py::object& self) { return of_modes(self, number); });
  };
  def_modes("weight", &Mode::weight);
  def_modes("x_px", &Mode::x_px);
  def_modes("y_px", &Mode::y_px);
  def_modes("xx_px2", &Mode::xx_px2);
  def_modes("xy_px2", &Mode::xy_px2);
  def_modes("yy_px2", &Mode::yy_px2);
  def_modes("texture", &Mode::texture);
  def_modes("weight_sd", &Mode::weight_sd);
  def_modes("centre_sd_px", &Mode::centre_sd_px);
  matte.def("composite", &composite);
}

void bind_pictures(py::module_& module) {
  module.def("read_picture", [](const std::string& path) {
    return array_of(without_gil([&] { return value_of(read_radiance(path, Encoding::kDisplay)); }));
  });
  module.def("write_picture", [](const std::string& path, const Floats& picture) {
    const RadianceImage image = image_of(picture);
    const absl::Status written = without_gil([&] { return write_radiance(path, image, Encoding::kDisplay); });
    if (!written.ok()) throw StatusError{written};
  });
  module.def("resized", [](const Floats& picture, int width_px, int height_px) {
    const RadianceImage image = image_of(picture);
    return array_of(without_gil([&] { return resized(image, width_px, height_px); }));
  });
  module.def("encode_png16", [](const Floats& picture) {
    Image16 codes(static_cast<int>(picture.shape(1)), static_cast<int>(picture.shape(0)));
    std::transform(picture.data(), picture.data() + picture.size(), codes.samples.begin(), code16_of);
    return py::bytes(without_gil([&] { return value_of(encode_png16(codes)); }));
  });
  module.def("linear_of_srgb", [](const Floats& codes) { return mapped(codes, &linear_of_srgb); });
  module.def("srgb_of_linear", [](const Floats& light) { return mapped(light, &srgb_of_linear); });
}

}  // namespace
}  // namespace glasswing

PYBIND11_MODULE(_native, module) {
  pybind11::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const glasswing::StatusError& error) {
      glasswing::raise(error.status);
    }
  });
  glasswing::bind_matte(module);
  glasswing::bind_pictures(module);
}
