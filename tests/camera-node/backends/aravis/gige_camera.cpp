#include "tests/camera-node/backends/aravis/gige_camera.h"

#include <arv.h>

#include <cstring>

namespace glasswing {

struct GigeCamera::Aravis {
  Expose expose;
  ArvGvFakeCamera* camera = nullptr;
};

namespace {

// Which channel a photosite of a mosaic has, by the row's and the column's parity.
int channel_at(ArvPixelFormat format, int x, int y) {
  const bool red_row = format == ARV_PIXEL_FORMAT_BAYER_RG_8 || format == ARV_PIXEL_FORMAT_BAYER_GR_8;
  const bool green_first = format == ARV_PIXEL_FORMAT_BAYER_GR_8 || format == ARV_PIXEL_FORMAT_BAYER_GB_8;
  const bool in_red_row = (y % 2 == 0) == red_row,
             green = (x % 2 == 0) == (in_red_row == red_row ? green_first : !green_first);
  return green ? 1 : in_red_row ? 0 : 2;
}

void write(const Image16& image, ArvPixelFormat format, std::uint8_t* to) {
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const std::uint16_t mean =
          static_cast<std::uint16_t>((image.at(x, y, 0) + image.at(x, y, 1) + image.at(x, y, 2)) / 3);
      if (format == ARV_PIXEL_FORMAT_MONO_8) {
        *to++ = static_cast<std::uint8_t>(mean >> 8);
      } else if (format == ARV_PIXEL_FORMAT_MONO_16) {
        std::memcpy(to, &mean, 2);
        to += 2;
      } else if (format == ARV_PIXEL_FORMAT_RGB_8_PACKED) {
        for (int c = 0; c < 3; ++c) *to++ = static_cast<std::uint8_t>(image.at(x, y, c) >> 8);
      } else {
        *to++ = static_cast<std::uint8_t>(image.at(x, y, channel_at(format, x, y)) >> 8);
      }
    }
  }
}

void fill(ArvBuffer* buffer, void* data, guint32 exposure_us, guint32, ArvPixelFormat format) {
  const GigeCamera::Exposure exposure{.start = monotonic_now(),
                                      .length = std::chrono::microseconds(exposure_us),
                                      .width_px = arv_buffer_get_image_width(buffer),
                                      .height_px = arv_buffer_get_image_height(buffer)};
  const Image16 image = static_cast<GigeCamera::Aravis*>(data)->expose(exposure);
  size_t size_bytes = 0;  // stays 0: the fake camera does not say how much it has
  write(image, format,
        static_cast<std::uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, &size_bytes))));
}

}  // namespace

GigeCamera::GigeCamera(const std::string& address, const std::string& serial, double lost, Expose expose)
    : aravis_(std::make_unique<Aravis>(Aravis{.expose = std::move(expose)})) {
  aravis_->camera = arv_gv_fake_camera_new(address.c_str(), serial.c_str());
  g_object_set(aravis_->camera, "gvsp-lost-ratio", lost, nullptr);
  ArvFakeCamera* const fake = arv_gv_fake_camera_get_fake_camera(aravis_->camera);
  // It looks for triggers so often; with its own 25 Hz they would wait.
  arv_fake_camera_set_trigger_frequency(fake, 2000.0);
  arv_fake_camera_set_fill_pattern(fake, fill, aravis_.get());
}

GigeCamera::~GigeCamera() {
  g_object_unref(aravis_->camera);
}

bool GigeCamera::is_running() const {
  return arv_gv_fake_camera_is_running(aravis_->camera);
}

}  // namespace glasswing
