// The C++ part of the Python package: files of mattes and of rays, compositing, and picture files.
// glasswing/_native.pyi has the types; only the package calls this module, and it checks shapes first.
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

#include "core/base/checksum.h"
#include "core/composite/compositor.h"
#include "core/composite/fast_compositor.h"
#include "core/file/file.h"
#include "core/file/mapped_file.h"
#include "core/footprint/composite_error.h"
#include "core/footprint/matte_transport.h"
#include "core/geometry/rig_geometry.h"
#include "core/image/image.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/matte/pyramid_share.h"
#include "core/rays/match_rays.h"
#include "core/rays/ray_file.h"
#include "core/rays/surroundings.h"

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
  explicit NativeMatte(Matte matte) : matte_(std::move(matte)) {
    // One F for composites, matrices and readers of the array.
    for (int y = 0; matte_.has_pyramids() && y < matte_.height_px(); ++y) {
      for (int x = 0; x < matte_.width_px(); ++x) {
        for (int c = 0; c < kChannels; ++c) {
          matte_.foreground(x, y)[c] = matte_.foreground_of_gaussians(x, y, c);
          for (PyramidFootprint& pyramid : matte_.pyramids(x, y, c)) pyramid.foreground = 0.0f;
        }
      }
    }
  }
  static std::unique_ptr<NativeMatte> decode(std::string_view bytes) {
    return std::make_unique<NativeMatte>(value_of(decode_matte(bytes, Pyramids::kKept)));
  }
  static std::unique_ptr<NativeMatte> read(const std::string& path) {
    const auto file = value_of(MappedFile::open(path));
    absl::StatusOr<Matte> matte = decode_matte(file->bytes(), Pyramids::kKept);
    if (!matte.ok())
      throw StatusError{
          absl::Status(matte.status().code(), path + ": " + std::string(matte.status().message()))};
    return std::make_unique<NativeMatte>(*std::move(matte));
  }

  // Not const, since a const Matte returns pixels by value.
  Matte& matte() { return matte_; }
  const Matte& matte() const { return matte_; }

  // `thread_count`: 0 uses all cores; the result does not depend on it.
  RadianceImage composite(std::vector<RadianceImage> backgrounds, bool exact, int thread_count) const {
    fit(backgrounds);
    if (exact) return value_of(glasswing::composite(matte_, backgrounds, thread_count));
    return value_of(prepared(thread_count).composite(backgrounds, thread_count));
  }

  // For those who use modes alone.
  Matte modes() const {
    Matte modes = matte_;
    modes.drop_pyramids();
    return modes;
  }

  RadianceImage error(std::vector<RadianceImage> backgrounds, int thread_count) const {
    fit(backgrounds);
    return value_of(composite_error(matte_, backgrounds, thread_count));
  }

 private:
  void fit(std::vector<RadianceImage>& backgrounds) const {
    for (size_t t = 0; t < backgrounds.size(); ++t) {
      if (backgrounds[t].empty()) continue;
      const v1::Monitor& monitor = matte_.metadata.monitors(static_cast<int>(t));
      backgrounds[t] = resized(backgrounds[t], monitor.width_px(), monitor.height_px());
    }
  }

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

// One value per pixel of a matte or of rays: height x width.
template <typename Pixels, typename Value>
py::array of_pixels(const py::object& self, const Pixels& pixels, const Value& first) {
  const py::ssize_t size = sizeof(Value);
  return view(self, first, {pixels.height_px(), pixels.width_px()}, {pixels.width_px() * size, size});
}

template <typename Pixels>
py::array foreground_of(const py::object& self, Pixels& pixels) {
  const py::ssize_t size = sizeof(float), pixel = kChannels * size;
  return view(self, pixels.foreground(0, 0).front(), {pixels.height_px(), pixels.width_px(), kChannels},
              {pixels.width_px() * pixel, pixel, size});
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

// One background for each of the matte's monitors; None is black.
using Pictures = std::vector<std::optional<Floats>>;

std::vector<RadianceImage> backgrounds_of(const Pictures& pictures) {
  std::vector<RadianceImage> backgrounds;
  for (const std::optional<Floats>& picture : pictures)
    backgrounds.push_back(picture ? image_of(*picture) : RadianceImage());
  return backgrounds;
}

Floats composite(const NativeMatte& matte, const Pictures& pictures, bool exact, int thread_count) {
  std::vector<RadianceImage> behind = backgrounds_of(pictures);
  return array_of(without_gil([&] { return matte.composite(std::move(behind), exact, thread_count); }));
}

Floats error_of(const NativeMatte& matte, const Pictures& pictures, int thread_count) {
  std::vector<RadianceImage> behind = backgrounds_of(pictures);
  return array_of(without_gil([&] { return matte.error(std::move(behind), thread_count); }));
}

template <typename Value>
py::array_t<Value> array_of(std::vector<Value> values) {
  const auto size = static_cast<py::ssize_t>(values.size());
  auto owned = std::make_unique<std::vector<Value>>(std::move(values));
  const Value* const first = owned->data();
  return py::array_t<Value>(size, first, py::capsule(owned.release(), [](void* kept) {
                              delete static_cast<std::vector<Value>*>(kept);
                            }));
}

// The values, errors, columns and row starts of the matrix of a channel; no errors: None.
py::tuple transport_of(const NativeMatte& self, int channel, bool errors, int thread_count) {
  TransportMatrix matrix = without_gil([&] {
    const MatteTransport transport = value_of(MatteTransport::create(self.matte()));
    return value_of(transport.matrix(channel, errors, thread_count));
  });
  const py::object sd = matrix.errors.size() == matrix.values.size()
                            ? py::object(array_of(std::move(matrix.errors)))
                            : py::object(py::none());
  return py::make_tuple(array_of(std::move(matrix.values)), sd, array_of(std::move(matrix.columns)),
                        array_of(std::move(matrix.starts)));
}

Floats from_monitor(const NativeMatte& self, int texture, const std::optional<Floats>& picture,
                    int thread_count) {
  const Matte& matte = self.matte();
  RadianceImage shone(matte.width_px(), matte.height_px());
  if (picture) {
    shone = image_of(*picture);
  } else {
    std::fill(shone.samples.begin(), shone.samples.end(), 1.0f);
  }
  return array_of(without_gil([&] {
    return value_of(composite_from_monitor(
        matte, texture, resized(shone, matte.width_px(), matte.height_px()), thread_count));
  }));
}

// Where a pixel's light from a monitor comes from.
Floats footprint_of_pixel(const NativeMatte& self, int x, int y, int texture) {
  return array_of(without_gil([&] { return footprint_picture(self.matte(), x, y, texture); }));
}

// Pixels that have pyramids: height x width.
py::array_t<bool> has_pyramid(const NativeMatte& self) {
  const Matte& matte = self.matte();
  py::array_t<bool> has({matte.height_px(), matte.width_px()});
  auto pixels = has.mutable_unchecked<2>();
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) pixels(y, x) = matte.has_pyramid(x, y);
  }
  return has;
}

// Arrays that mattes and rays share; `pixels_of` finds the pixels of a Python object.
template <typename Class, typename PixelsOf>
void def_pixels(Class& bound, PixelsOf pixels_of) {
  bound.def_property_readonly(
      "foreground", [pixels_of](const py::object& self) { return foreground_of(self, pixels_of(self)); });
  bound.def_property_readonly("coverage", [pixels_of](const py::object& self) {
    return of_pixels(self, pixels_of(self), pixels_of(self).coverage(0, 0));
  });
  bound.def_property_readonly("flags", [pixels_of](const py::object& self) {
    return of_pixels(self, pixels_of(self), pixels_of(self).flags(0, 0));
  });
}

void bind_matte(py::module_& module) {
  py::class_<NativeMatte> matte(module, "NativeMatte");
  matte.def_static(
      "read", [](const std::string& path) { return without_gil([&] { return NativeMatte::read(path); }); });
  matte.def_static("decode", [](std::string_view bytes) {
    return without_gil([&] { return NativeMatte::decode(bytes); });
  });
  matte.def_property_readonly(
      "metadata", [](NativeMatte& self) { return py::bytes(self.matte().metadata.SerializeAsString()); });
  def_pixels(matte, &matte_of);
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
  matte.def("error", &error_of);
  matte.def("transport", &transport_of);
  matte.def("from_monitor", &from_monitor);
  matte.def("footprint", &footprint_of_pixel);
  matte.def_property_readonly("has_pyramid", &has_pyramid);
  matte.def("lost_text", [](const NativeMatte& self, const std::string& holders) {
    return lost_text(pyramid_share(self.matte()), holders);
  });
}

// Immutable, as NativeMatte.
class NativeRays {
 public:
  explicit NativeRays(RayMatte rays) : rays_(std::move(rays)) {}
  RayMatte& rays() { return rays_; }
  const RayMatte& rays() const { return rays_; }

 private:
  RayMatte rays_;
};

v1::RigGeometry geometry_of(const std::string& bytes) {
  v1::RigGeometry geometry;
  absl::Status status = absl::InvalidArgumentError("the geometry is not a RigGeometry message");
  if (geometry.ParseFromString(bytes)) status = check_geometry(geometry);
  if (!status.ok()) throw StatusError{status};
  return geometry;
}

// `planes`: depths (mm) and pictures; `environment`: a picture, or None.
Floats composite_of_rays(const NativeRays& self, const std::vector<std::pair<double, Floats>>& planes,
                         const std::optional<Floats>& environment, double turn_rad, bool lossless, bool exact,
                         int thread_count) {
  Surroundings around{.planes = {}, .environment = std::nullopt, .lossless = lossless};
  if (environment) around.environment = Environment{image_of(*environment), turn_rad};
  const v1::MonitorPose& pose = *value_of(nearest_pose(self.rays()));
  for (const auto& [depth_mm, picture] : planes)
    around.planes.push_back(picture_at(pose, depth_mm, image_of(picture)));
  return array_of(
      without_gil([&] { return value_of(composite_rays(self.rays(), around, exact, thread_count)); }));
}

RayMatte& rays_of(const py::object& self) {
  return self.cast<NativeRays&>().rays();
}

// Numbers of each ray: height x width x 3 x rays, then `shape`; `first` points to the first ray's first
// number.
template <typename Value>
py::array of_rays(const py::object& self, const Value& first, const std::vector<py::ssize_t>& shape = {}) {
  const RayMatte& rays = rays_of(self);
  std::vector<py::ssize_t> shapes{rays.height_px(), rays.width_px(), kChannels, rays.rays_per_channel()};
  std::vector<py::ssize_t> strides(shapes.size(), sizeof(Ray));
  shapes.insert(shapes.end(), shape.begin(), shape.end());
  for (size_t axis = 3; axis-- > 0;) strides[axis] = strides[axis + 1] * shapes[axis + 1];
  strides.resize(shapes.size(), sizeof(Value));
  for (size_t axis = shapes.size() - 1; axis-- > 4;) strides[axis] = strides[axis + 1] * shapes[axis + 1];
  return view(self, first, std::move(shapes), std::move(strides));
}

void bind_rays(py::module_& module) {
  py::class_<NativeRays> rays(module, "NativeRays");
  rays.def_static("read", [](const std::string& path) {
    return std::make_unique<NativeRays>(without_gil([&] { return value_of(read_rays(path)); }));
  });
  rays.def_static("decode", [](std::string_view bytes) {
    return std::make_unique<NativeRays>(without_gil([&] { return value_of(decode_rays(bytes)); }));
  });
  rays.def_static("match", [](NativeMatte& one, NativeMatte& other, const std::string& geometry,
                              const std::vector<std::string>& poses) {
    return std::make_unique<NativeRays>(without_gil(
        [&] { return value_of(match_rays(one.modes(), other.modes(), geometry_of(geometry), poses)); }));
  });
  rays.def_static("far_light", [](NativeMatte& matte, const std::string& geometry, const std::string& pose,
                                  double object_depth_mm) {
    return std::make_unique<NativeRays>(without_gil([&] {
      return value_of(far_light_rays(matte.modes(), geometry_of(geometry), pose, object_depth_mm));
    }));
  });
  rays.def("write", [](const NativeRays& self, const std::string& path) {
    without_gil([&] {
      const absl::Status written = write_file_durably(path, value_of(encode_rays(self.rays())));
      if (!written.ok()) throw StatusError{written};
      return 0;
    });
  });
  rays.def("composite", &composite_of_rays);
  rays.def_property_readonly(
      "metadata", [](NativeRays& self) { return py::bytes(self.rays().metadata.SerializeAsString()); });
  def_pixels(rays, &rays_of);
  const auto def_rays = [&rays](const char* name, auto first, std::vector<py::ssize_t> shape = {}) {
    rays.def_property_readonly(name, [first, shape = std::move(shape)](const py::object& self) {
      return of_rays(self, first(rays_of(self).rays(0, 0, 0).front()), shape);
    });
  };
  constexpr py::ssize_t kXyz = 3, kUv = 2;
  static_assert(sizeof(Ray::origin_spread_mm) == kUv * kXyz * sizeof(float));
  using Ref = const float&;
  def_rays("weight", [](const Ray& ray) -> Ref { return ray.weight; });
  def_rays("origin_mm", [](const Ray& ray) -> Ref { return ray.origin_mm[0]; }, {kXyz});
  def_rays("direction", [](const Ray& ray) -> Ref { return ray.direction[0]; }, {kXyz});
  def_rays("origin_spread_mm", [](const Ray& ray) -> Ref { return ray.origin_spread_mm[0][0]; }, {kUv, kXyz});
  def_rays("direction_spread", [](const Ray& ray) -> Ref { return ray.direction_spread[0][0]; }, {kUv, kXyz});
  def_rays("origin_sd_mm", [](const Ray& ray) -> Ref { return ray.origin_sd_mm; });
  def_rays("direction_sd", [](const Ray& ray) -> Ref { return ray.direction_sd; });
  def_rays("state", [](const Ray& ray) -> const std::uint8_t& {
    return reinterpret_cast<const std::uint8_t&>(ray.state);
  });
}

void bind_checksum(py::module_& module) {
  module.def("checksum", [](std::string_view bytes) {
    RunningChecksum checksum;
    checksum.add(bytes);
    return checksum.value();
  });
}

void bind_geometry(py::module_& module) {
  module.def("read_geometry", [](const std::string& path) {
    return py::bytes(without_gil([&] { return value_of(read_geometry(path)).SerializeAsString(); }));
  });
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
  glasswing::bind_rays(module);
  glasswing::bind_checksum(module);
  glasswing::bind_geometry(module);
  glasswing::bind_pictures(module);
}
