// The memory of a simulated GigE Vision camera: the bootstrap registers of the standard, the features of the
// GenICam file that it describes itself with, and that file. All numbers are big endian.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/image/image_file.h"

namespace glasswing {

// How the camera's samples share bytes.
struct WireFormat {
  std::string_view name;
  std::uint32_t code;  // of the GenICam pixel format naming convention
  int bits;
  enum class Packing { kNone, kBits, kGige } packing = Packing::kNone;
  char mosaic = 0;  // 'r': the first row begins red, green
};

class WireRegisters {
 public:
  static constexpr std::uint32_t kWidth = 0x3000, kHeight = 0x3004, kOffsetX = 0x3008, kOffsetY = 0x300c,
                                 kPixelFormat = 0x3010, kPayloadSize = 0x3014, kAcquisitionStart = 0x301c,
                                 kAcquisitionStop = 0x3020, kTriggerMode = 0x3024, kTriggerSource = 0x3028,
                                 kTriggerSoftware = 0x302c, kChunkMode = 0x3030, kChunkSelector = 0x3034,
                                 kChunkEnable = 0x3038, kPtpEnable = 0x3048, kPtpStatus = 0x304c,
                                 kExposureTime = 0x3060, kGain = 0x3068, kBlackLevel = 0x3070,
                                 kFrameRate = 0x3078, kTriggerDelay = 0x3080, kTemperature = 0x3088,
                                 kSensorWidth = 0x3090, kSensorHeight = 0x3094;
  static constexpr std::uint32_t kCurrentAddress = 0x24, kModel = 0x68, kSerial = 0xd8, kHeartbeat_ms = 0x938,
                                 kControl = 0xa00, kStreamPort = 0xd00, kPacketSize = 0xd04,
                                 kStreamAddress = 0xd18;
  static constexpr int kBootstrap_bytes = 0xf8;
  static constexpr std::uint32_t kChunkExposure = 1, kChunkGain = 2;  // ids of the chunks

  // `address`: in the machine's byte order. `chunks`, `ptp`: whether the camera has them.
  WireRegisters(std::uint32_t address, const std::string& serial, PictureSize sensor, bool chunks, bool ptp);

  std::uint32_t get(std::uint32_t at) const;
  double get_double(std::uint32_t at) const;
  void set(std::uint32_t at, std::uint32_t value);
  void set_double(std::uint32_t at, double value);
  // False: it lies outside the memory.
  bool read(std::uint32_t at, std::span<std::uint8_t> to) const;
  bool write(std::uint32_t at, std::span<const std::uint8_t> from);

  static std::span<const WireFormat> formats();
  const WireFormat& format() const;
  PictureSize size() const;
  int image_bytes() const;
  bool sends_chunk(std::uint32_t id) const;

 private:
  void update_payload();

  mutable std::mutex mutex_;
  std::vector<std::uint8_t> memory_;  // guarded by mutex_
};

// Samples of a row of `width` codes of 16 bits each, of which the format keeps the highest.
void pack(std::span<const std::uint16_t> codes, const WireFormat& format, std::vector<std::uint8_t>& to);

}  // namespace glasswing
