// The filter "Glasswing" for frei0r's hosts: Kdenlive, MLT, ffmpeg (docs/hosts.md).
//
// frei0r has no way to report an error. What is wrong is written to stderr, once, and the frames get a red
// and white border until it is mended. Without a matte, as hosts add the filter, frames are left alone.
extern "C" {
#include <frei0r.h>
}

#include <algorithm>
#include <cstdio>
#include <exception>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "compositing/hosts/frei0r/object_in_frame.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr f0r_param_info_t kParameters[] = {
    {"Matte", F0R_PARAM_STRING, "File of the matte (.exr), as glasswing fetch writes it"},
    {"X", F0R_PARAM_DOUBLE, "Middle of the matte's picture, in widths of the frame from its left"},
    {"Y", F0R_PARAM_DOUBLE, "Middle of the matte's picture, in heights of the frame from its top"},
    {"Size", F0R_PARAM_DOUBLE, "Size of the matte's picture; 1 is the largest that fits the frame"},
    {"Whole picture", F0R_PARAM_BOOL, "Show the camera's whole picture rather than the object in the frame"},
    {"Monitor", F0R_PARAM_STRING, "Name of the monitor that the frame is on; empty: the first"},
};
enum Parameter { kMatte, kX, kY, kSize, kWholePicture, kMonitor };

class Filter {
 public:
  Filter(int width_px, int height_px) : width_px_(width_px), height_px_(height_px) {}

  void set(int parameter, f0r_param_t value) {
    const std::lock_guard lock(mutex_);
    if (std::string* const text = text_of(parameter))
      *text = *static_cast<f0r_param_string*>(value);
    else if (parameter == kWholePicture)
      placement_.whole_picture = *static_cast<f0r_param_bool*>(value) >= 0.5;
    else if (double* const number = number_of(parameter))
      *number = *static_cast<f0r_param_double*>(value);
  }

  void get(int parameter, f0r_param_t value) {
    const std::lock_guard lock(mutex_);
    if (std::string* const text = text_of(parameter))
      *static_cast<f0r_param_string*>(value) = text->data();
    else if (parameter == kWholePicture)
      *static_cast<f0r_param_bool*>(value) = placement_.whole_picture ? 1.0 : 0.0;
    else if (const double* const number = number_of(parameter))
      *static_cast<f0r_param_double*>(value) = *number;
  }

  void update(const std::uint8_t* frame, std::uint8_t* out) {
    const size_t size = static_cast<size_t>(width_px_) * height_px_ * 4;
    absl::Status status;
    try {
      status = composite({frame, size}, {out, size});
    } catch (const std::exception& error) {  // no memory, or OpenCV's
      status = absl::InternalError(error.what());
    }
    if (status.ok()) return;
    std::copy_n(frame, size, out);
    mark(out);
    complain(std::string(status.message()));
  }

 private:
  std::string* text_of(int parameter) {
    return parameter == kMatte ? &matte_ : parameter == kMonitor ? &placement_.monitor : nullptr;
  }
  double* number_of(int parameter) {
    return parameter == kX      ? &placement_.x
           : parameter == kY    ? &placement_.y
           : parameter == kSize ? &placement_.size
                                : nullptr;
  }

  absl::Status composite(std::span<const std::uint8_t> frame, std::span<std::uint8_t> out) {
    std::shared_ptr<const ObjectInFrame> object;
    Placement placement;
    {
      const std::lock_guard lock(mutex_);
      if (matte_.empty()) {
        std::ranges::copy(frame, out.begin());
        return absl::OkStatus();
      }
      if (opened_ != matte_) {
        opened_ = matte_;
        object_.reset();
        absl::StatusOr<ObjectInFrame> opened = ObjectInFrame::open(matte_);
        failure_ = opened.status();
        if (opened.ok()) object_ = std::make_shared<const ObjectInFrame>(*std::move(opened));
      }
      GW_RETURN_IF_ERROR(failure_);
      object = object_;
      placement = placement_;
    }
    return object->composite(placement, width_px_, height_px_, frame, out);
  }

  // Draws a border of red and white stripes.
  void mark(std::uint8_t* out) const {
    const int border_px = std::max(4, height_px_ / 24);
    for (int y = 0; y < height_px_; ++y) {
      for (int x = 0; x < width_px_; ++x, out += 4) {
        if (std::min({x, y, width_px_ - 1 - x, height_px_ - 1 - y}) >= border_px) continue;
        const bool red = (x + y) / border_px % 2 == 0;
        const std::uint8_t rest = red ? 0 : 255;
        out[0] = 255, out[1] = rest, out[2] = rest, out[3] = 255;
      }
    }
  }

  void complain(const std::string& message) {
    const std::lock_guard lock(mutex_);
    if (message == complaint_) return;
    complaint_ = message;
    std::fprintf(stderr, "glasswing: %s\n", message.c_str());
  }

  const int width_px_, height_px_;
  std::mutex mutex_;  // MLT calls from several threads
  std::string matte_;
  Placement placement_;
  std::optional<std::string> opened_;  // the matte that object_ or failure_ is of
  std::shared_ptr<const ObjectInFrame> object_;
  absl::Status failure_;
  std::string complaint_;
};

Filter& filter_of(f0r_instance_t instance) {
  return *static_cast<Filter*>(instance);
}

}  // namespace
}  // namespace glasswing

extern "C" {

int f0r_init() {
  return 1;
}

void f0r_deinit() {}

void f0r_get_plugin_info(f0r_plugin_info_t* info) {
  *info = {.name = "Glasswing",
           .author = "Glasswing",
           .plugin_type = F0R_PLUGIN_TYPE_FILTER,
           .color_model = F0R_COLOR_MODEL_RGBA8888,
           .frei0r_version = FREI0R_MAJOR_VERSION,
           .major_version = 0,
           .minor_version = 1,
           .num_params = static_cast<int>(std::size(glasswing::kParameters)),
           .explanation = "A captured object in front of the frame, which it refracts and blurs"};
}

void f0r_get_param_info(f0r_param_info_t* info, int parameter) {
  *info = glasswing::kParameters[parameter];
}

f0r_instance_t f0r_construct(unsigned int width, unsigned int height) {
  return new (std::nothrow) glasswing::Filter(static_cast<int>(width), static_cast<int>(height));
}

void f0r_destruct(f0r_instance_t instance) {
  delete &glasswing::filter_of(instance);
}

void f0r_set_param_value(f0r_instance_t instance, f0r_param_t value, int parameter) {
  glasswing::filter_of(instance).set(parameter, value);
}

void f0r_get_param_value(f0r_instance_t instance, f0r_param_t value, int parameter) {
  glasswing::filter_of(instance).get(parameter, value);
}

void f0r_update(f0r_instance_t instance, double, const std::uint32_t* frame, std::uint32_t* out) {
  glasswing::filter_of(instance).update(reinterpret_cast<const std::uint8_t*>(frame),
                                        reinterpret_cast<std::uint8_t*>(out));
}

}  // extern "C"
