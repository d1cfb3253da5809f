#include "tests/camera-node/backends/aravis/wire_registers.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

namespace glasswing {
namespace {

using Packing = WireFormat::Packing;
constexpr std::uint32_t kFile = 0x10000;  // where the GenICam file lies

constexpr WireFormat kFormats[] = {
    {"Mono8", 0x01080001, 8},
    {"Mono10", 0x01100003, 10},
    {"Mono10p", 0x010A0046, 10, Packing::kBits},
    {"Mono10Packed", 0x010C0004, 10, Packing::kGige},
    {"Mono12", 0x01100005, 12},
    {"Mono12p", 0x010C0047, 12, Packing::kBits},
    {"Mono12Packed", 0x010C0006, 12, Packing::kGige},
    {"Mono16", 0x01100007, 16},
    {"BayerRG12p", 0x010C0059, 12, Packing::kBits, 'r'},
    {"BayerRG12Packed", 0x010C002B, 12, Packing::kGige, 'r'},
};

using R = WireRegisters;

struct Feature {
  const char* name;
  std::uint32_t at;
  double min, max;
  int step = 1;
  const char* unit = "";
  bool writable = true;
};

constexpr Feature kIntegers[] = {{"Width", R::kWidth, 16, 8192, 4},
                                 {"Height", R::kHeight, 16, 8192, 2},
                                 {"OffsetX", R::kOffsetX, 0, 8192, 2},
                                 {"OffsetY", R::kOffsetY, 0, 8192, 2},
                                 {"SensorWidth", R::kSensorWidth, 0, 8192, 1, "", false},
                                 {"SensorHeight", R::kSensorHeight, 0, 8192, 1, "", false},
                                 {"PayloadSize", R::kPayloadSize, 0, 4294967295.0, 1, "", false},
                                 {"GevSCPSPacketSize", R::kPacketSize, 0, 65535}};
constexpr Feature kFloats[] = {{"ExposureTime", R::kExposureTime, 20, 1e7, 1, "us"},
                               {"Gain", R::kGain, 0, 24, 1, "dB"},
                               {"BlackLevel", R::kBlackLevel, 0, 255},
                               {"AcquisitionFrameRate", R::kFrameRate, 0.1, 1000, 1, "Hz"},
                               {"TriggerDelay", R::kTriggerDelay, 0, 1e7, 1, "us"},
                               {"DeviceTemperature", R::kTemperature, -40, 125, 1, "C", false}};
constexpr Feature kCommands[] = {{"AcquisitionStart", R::kAcquisitionStart, 0, 1},
                                 {"AcquisitionStop", R::kAcquisitionStop, 0, 1},
                                 {"TriggerSoftware", R::kTriggerSoftware, 0, 1}};

std::string reg(const char* kind, const std::string& name, std::uint32_t at, int bytes, const char* more = "",
                const char* port = "Device", const char* access = "RW") {
  return fmt::format(
      "<{0} Name=\"{1}\"><Address>0x{2:x}</Address>{3}<Length>{4}</Length><AccessMode>{5}</AccessMode>"
      "<pPort>{6}</pPort><Cachable>NoCache</Cachable>{7}<Endianess>BigEndian</Endianess></{0}>\n",
      kind, name, at, more, bytes, access, port,
      std::string_view(kind) == "IntReg" ? "<Sign>Unsigned</Sign>" : "");
}

std::string enumeration(const std::string& name, std::uint32_t at,
                        const std::vector<std::pair<std::string, std::uint32_t>>& entries,
                        const char* more = "", const char* access = "RW") {
  std::string text = fmt::format("<Enumeration Name=\"{}\">{}", name, more);
  for (const auto& [entry, value] : entries)
    text += fmt::format("<EnumEntry Name=\"{}\"><Value>{}</Value></EnumEntry>", entry, value);
  return text + fmt::format("<pValue>{0}Reg</pValue></Enumeration>\n", name) +
         reg("IntReg", name + "Reg", at, 4, "", "Device", access);
}

std::string boolean(const std::string& name, std::uint32_t at, const char* more = "") {
  return fmt::format("<Boolean Name=\"{0}\"><pValue>{0}Reg</pValue></Boolean>\n", name) +
         reg("IntReg", name + "Reg", at, 4, more);
}

std::string chunk_xml() {
  std::string xml = boolean("ChunkModeActive", R::kChunkMode) +
                    enumeration("ChunkSelector", R::kChunkSelector,
                                {{"ExposureTime", R::kChunkExposure}, {"Gain", R::kChunkGain}},
                                "<pSelected>ChunkEnable</pSelected>") +
                    boolean("ChunkEnable", R::kChunkEnable, "<pIndex Offset=\"4\">ChunkSelectorReg</pIndex>");
  for (const auto& [name, id] :
       {std::pair("ChunkExposureTime", R::kChunkExposure), std::pair("ChunkGain", R::kChunkGain)}) {
    xml += fmt::format("<Float Name=\"{0}\"><pValue>{0}Reg</pValue></Float>", name) +
           fmt::format("<Port Name=\"{}Port\"><ChunkID>{:08x}</ChunkID></Port>\n", name, id) +
           reg("FloatReg", fmt::format("{}Reg", name), 0, 8, "", fmt::format("{}Port", name).c_str(), "RO");
  }
  return xml;
}

std::string genicam_file(bool chunks, bool ptp) {
  std::string features, xml;
  const auto add = [&](const std::string& name, const std::string& text) {
    features += fmt::format("<pFeature>{}</pFeature>", name);
    xml += text;
  };
  for (const Feature& each : kIntegers) {
    const std::string name = each.name;
    add(name, fmt::format("<Integer Name=\"{0}\"><pValue>{0}Reg</pValue><Min>{1}</Min><Max>{2:.0f}</Max>"
                          "<Inc>{3}</Inc></Integer>\n",
                          name, each.min, each.max, each.step) +
                  reg("IntReg", name + "Reg", each.at, 4, "", "Device", each.writable ? "RW" : "RO"));
  }
  for (const Feature& each : kFloats) {
    const std::string name = each.name;
    add(name, fmt::format("<Float Name=\"{0}\"><pValue>{0}Reg</pValue><Min>{1}</Min><Max>{2}</Max>"
                          "<Unit>{3}</Unit></Float>\n",
                          name, each.min, each.max, each.unit) +
                  reg("FloatReg", name + "Reg", each.at, 8, "", "Device", each.writable ? "RW" : "RO"));
  }
  for (const Feature& each : kCommands) {
    const std::string name = each.name;
    add(name,
        fmt::format("<Command Name=\"{0}\"><pValue>{0}Reg</pValue><CommandValue>1</CommandValue></Command>\n",
                    name) +
            reg("IntReg", name + "Reg", each.at, 4));
  }
  std::vector<std::pair<std::string, std::uint32_t>> formats;
  for (const WireFormat& each : kFormats) formats.emplace_back(each.name, each.code);
  add("PixelFormat", enumeration("PixelFormat", R::kPixelFormat, formats));
  add("AcquisitionMode", enumeration("AcquisitionMode", 0x3018, {{"Continuous", 0}}));
  add("TriggerSelector", enumeration("TriggerSelector", 0x3054, {{"FrameStart", 0}}));
  add("TriggerMode", enumeration("TriggerMode", R::kTriggerMode, {{"Off", 0}, {"On", 1}}));
  add("TriggerSource", enumeration("TriggerSource", R::kTriggerSource, {{"Software", 0}, {"Line1", 1}}));
  add("TriggerActivation", enumeration("TriggerActivation", 0x3050, {{"RisingEdge", 0}}));
  if (chunks) add("ChunkModeActive", chunk_xml());
  if (ptp) {
    add("PtpEnable", boolean("PtpEnable", R::kPtpEnable));
    add("PtpStatus",
        enumeration("PtpStatus", R::kPtpStatus, {{"Disabled", 3}, {"Listening", 4}, {"Slave", 9}}, "", "RO"));
  }
  return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<RegisterDescription ModelName=\"Wire\" "
         "VendorName=\"Glasswing\" StandardNameSpace=\"GEV\" SchemaMajorVersion=\"1\" "
         "SchemaMinorVersion=\"1\" SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" "
         "SubMinorVersion=\"0\" ToolTip=\"\" ProductGuid=\"a\" VersionGuid=\"b\" "
         "xmlns=\"http://www.genicam.org/GenApi/Version_1_1\">\n<Category Name=\"Root\">" +
         features + "</Category>\n" + xml + "<Port Name=\"Device\"></Port>\n</RegisterDescription>\n";
}

void put(std::vector<std::uint8_t>& memory, std::uint32_t at, std::string_view text) {
  std::ranges::copy(text, memory.begin() + at);
}

}  // namespace

WireRegisters::WireRegisters(std::uint32_t address, const std::string& serial, PictureSize sensor,
                             bool chunks, bool ptp) {
  const std::string file = genicam_file(chunks, ptp);
  memory_.resize(kFile + file.size() + 4);
  put(memory_, kFile, file);
  put(memory_, 0x48, "Glasswing");
  put(memory_, kModel, "Wire");
  put(memory_, 0x88, "1");
  put(memory_, kSerial, serial.substr(0, 15));
  put(memory_, 0x200, fmt::format("Local:wire.xml;{:x};{:x}", kFile, file.size()));
  set(0x0, 1 << 16 | 2);            // version 1.2
  set(0x4, 1u << 31 | 1);           // big endian, UTF-8
  set(0xc, 0x02000000u ^ address);  // of the hardware
  set(kCurrentAddress, address);
  set(0x904, 1);                  // stream channels
  set(0x934, 1u << 2 | 1u << 1);  // packet resend, memory writes
  set(kHeartbeat_ms, 3000);
  set(0x940, 1000000000);  // ticks a second
  set(kPacketSize, 1400);
  set(kSensorWidth, static_cast<std::uint32_t>(sensor.width_px));
  set(kSensorHeight, static_cast<std::uint32_t>(sensor.height_px));
  set(kWidth, static_cast<std::uint32_t>(sensor.width_px));
  set(kHeight, static_cast<std::uint32_t>(sensor.height_px));
  set(kPixelFormat, kFormats[0].code);
  set(kPtpStatus, 3);
  set_double(kExposureTime, 10000.0);
  set_double(kFrameRate, 30.0);
  set_double(kTemperature, 41.5);
}

std::uint32_t WireRegisters::get(std::uint32_t at) const {
  const std::lock_guard lock(mutex_);
  std::uint32_t value = 0;
  for (int i = 0; i < 4; ++i) value = value << 8 | memory_[at + i];
  return value;
}

double WireRegisters::get_double(std::uint32_t at) const {
  const std::uint64_t high = get(at);
  return std::bit_cast<double>(high << 32 | get(at + 4));
}

void WireRegisters::set(std::uint32_t at, std::uint32_t value) {
  {
    const std::lock_guard lock(mutex_);
    for (int i = 0; i < 4; ++i) memory_[at + i] = static_cast<std::uint8_t>(value >> (24 - 8 * i));
  }
  update_payload();
}

void WireRegisters::set_double(std::uint32_t at, double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  set(at, static_cast<std::uint32_t>(bits >> 32));
  set(at + 4, static_cast<std::uint32_t>(bits));
}

bool WireRegisters::read(std::uint32_t at, std::span<std::uint8_t> to) const {
  const std::lock_guard lock(mutex_);
  if (at > memory_.size() || to.size() > memory_.size() - at) return false;
  std::copy_n(memory_.begin() + at, to.size(), to.begin());
  return true;
}

bool WireRegisters::write(std::uint32_t at, std::span<const std::uint8_t> from) {
  if (at + from.size() > kFile) return false;
  {
    const std::lock_guard lock(mutex_);
    std::ranges::copy(from, memory_.begin() + at);
  }
  if (at == kPtpEnable) set(kPtpStatus, get(kPtpEnable) != 0 ? 9 : 3);
  update_payload();
  return true;
}

void WireRegisters::update_payload() {
  std::uint32_t bytes = static_cast<std::uint32_t>(image_bytes());
  if (get(kChunkMode) != 0) {
    bytes += 8;
    for (const std::uint32_t id : {kChunkExposure, kChunkGain}) bytes += sends_chunk(id) ? 16 : 0;
  }
  const std::lock_guard lock(mutex_);
  for (int i = 0; i < 4; ++i) memory_[kPayloadSize + i] = static_cast<std::uint8_t>(bytes >> (24 - 8 * i));
}

std::span<const WireFormat> WireRegisters::formats() {
  return kFormats;
}

const WireFormat& WireRegisters::format() const {
  const auto found = std::ranges::find(kFormats, get(kPixelFormat), &WireFormat::code);
  return found == std::end(kFormats) ? kFormats[0] : *found;
}

PictureSize WireRegisters::size() const {
  return {static_cast<int>(get(kWidth)), static_cast<int>(get(kHeight))};
}

int WireRegisters::image_bytes() const {
  const WireFormat& is = format();
  const int bits = is.packing == Packing::kGige   ? 12
                   : is.packing == Packing::kBits ? is.bits
                                                  : (is.bits + 7) / 8 * 8;
  return (size().width_px * bits + 7) / 8 * size().height_px;
}

bool WireRegisters::sends_chunk(std::uint32_t id) const {
  return get(kChunkMode) != 0 && get(kChunkEnable + 4 * id) != 0;
}

void pack(std::span<const std::uint16_t> codes, const WireFormat& format, std::vector<std::uint8_t>& to) {
  const auto byte = [&](unsigned value) { to.push_back(static_cast<std::uint8_t>(value)); };
  const int drop = 16 - format.bits;
  if (format.packing == Packing::kGige) {
    // High bits of the first sample; low bits of both; high bits of the second.
    const int low = format.bits - 8;
    const unsigned mask = (1u << low) - 1u;
    for (size_t x = 0; x + 1 < codes.size(); x += 2) {
      const unsigned a = codes[x] >> drop, b = codes[x + 1] >> drop;
      byte(a >> low);
      byte((a & mask) | (b & mask) << 4);
      byte(b >> low);
    }
    return;
  }
  if (format.packing == Packing::kBits) {
    unsigned held = 0;
    int bits = 0;
    for (const std::uint16_t code : codes) {
      held |= static_cast<unsigned>(code >> drop) << bits;
      for (bits += format.bits; bits >= 8; bits -= 8, held >>= 8) byte(held & 255u);
    }
    if (bits > 0) byte(held & 255u);
    return;
  }
  for (const std::uint16_t code : codes) {
    byte((code >> drop) & 255u);
    if (format.bits > 8) byte(static_cast<unsigned>(code >> drop) >> 8);
  }
}

}  // namespace glasswing
