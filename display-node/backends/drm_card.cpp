#include "display-node/backends/drm_card.h"

#include <drm_fourcc.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/mman.h>
#include <unistd.h>
#include <xf86drm.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <span>

#include "core/base/status.h"

namespace glasswing {
namespace {

template <auto release>
struct Release {
  template <typename T>
  void operator()(T* pointer) const {
    release(pointer);
  }
};
template <auto release, typename T>
std::unique_ptr<T, Release<release>> owned(T* pointer) {
  return std::unique_ptr<T, Release<release>>(pointer);
}

std::uint32_t format_of(int bits) {
  return bits == 10 ? DRM_FORMAT_XRGB2101010 : DRM_FORMAT_XRGB8888;
}

bool usable(const drmModeModeInfo& mode) {
  return (mode.flags & (DRM_MODE_FLAG_INTERLACE | DRM_MODE_FLAG_DBLSCAN)) == 0 && mode.vscan <= 1 &&
         mode.clock > 0 && mode.htotal > 0 && mode.vtotal > 0;
}

}  // namespace

absl::StatusOr<std::unique_ptr<DrmCard>> DrmCard::open(const std::string& path) {
  std::unique_ptr<DrmCard> card(new DrmCard());
  card->name_ = std::filesystem::path(path).filename();
  card->fd_ = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK);
  if (card->fd_ < 0)
    return absl::UnavailableError(fmt::format("{} cannot be opened: {}", path, std::strerror(errno)));
  GW_RETURN_IF_ERROR(card->check_abilities());
  card->find_connectors();
  return card;
}

DrmCard::~DrmCard() {
  // If this fails, the kernel shows its console once the card is closed by all.
  std::vector<Setting> settings;
  for (const auto& [where, value] : before_) settings.push_back({where.first, where.second, value});
  if (!settings.empty()) (void)commit(settings, DRM_MODE_ATOMIC_ALLOW_MODESET, 0);
  for (const Memory& memory : memory_) ::munmap(memory.mapped, memory.bytes);
  if (fd_ >= 0) ::close(fd_);
}

absl::Status DrmCard::check_abilities() {
  const auto lacks = [this](const char* what) {
    return absl::FailedPreconditionError(fmt::format("{} {}", name_, what));
  };
  const auto can = [this](std::uint64_t capability) {
    std::uint64_t value = 0;
    return drmGetCap(fd_, capability, &value) == 0 && value != 0;
  };
  const auto resources = owned<drmModeFreeResources>(drmModeGetResources(fd_));
  if (resources == nullptr || resources->count_connectors == 0) return lacks("has no connectors");
  crtcs_.assign(resources->crtcs, resources->crtcs + resources->count_crtcs);
  if (drmSetClientCap(fd_, DRM_CLIENT_CAP_UNIVERSAL_PLANES, 1) != 0 ||
      drmSetClientCap(fd_, DRM_CLIENT_CAP_ATOMIC, 1) != 0)
    return lacks("has a driver without atomic modesetting");
  if (!can(DRM_CAP_DUMB_BUFFER)) return lacks("has a driver without dumb buffers");
  if (!can(DRM_CAP_TIMESTAMP_MONOTONIC))
    return lacks("timestamps refreshes in a clock other than CLOCK_MONOTONIC");
  return absl::OkStatus();
}

void DrmCard::find_connectors() {
  const auto resources = owned<drmModeFreeResources>(drmModeGetResources(fd_));
  for (int i = 0; resources != nullptr && i < resources->count_connectors; ++i) {
    const auto found = owned<drmModeFreeConnector>(drmModeGetConnector(fd_, resources->connectors[i]));
    if (found == nullptr) continue;
    const char* const type = drmModeGetConnectorTypeName(found->connector_type);
    Connector& connector = connectors_.emplace_back();
    connector.name = fmt::format("{}-{}", type == nullptr ? "Unknown" : type, found->connector_type_id);
    connector.id = found->connector_id;
    for (int e = 0; e < found->count_encoders; ++e) {
      const auto encoder = owned<drmModeFreeEncoder>(drmModeGetEncoder(fd_, found->encoders[e]));
      if (encoder == nullptr) continue;
      connector.possible_crtcs |= encoder->possible_crtcs;
      if (encoder->encoder_id == found->encoder_id) connector.current_crtc = encoder->crtc_id;
    }
    if (found->connection == DRM_MODE_DISCONNECTED) continue;
    std::copy_if(found->modes, found->modes + found->count_modes, std::back_inserter(connector.modes),
                 usable);
    std::stable_partition(connector.modes.begin(), connector.modes.end(), [](const drmModeModeInfo& mode) {
      return (mode.type & DRM_MODE_TYPE_PREFERRED) != 0;
    });
  }
}

DrmCard::Properties DrmCard::properties_of(std::uint32_t object) const {
  Properties properties;
  const auto list =
      owned<drmModeFreeObjectProperties>(drmModeObjectGetProperties(fd_, object, DRM_MODE_OBJECT_ANY));
  for (std::uint32_t i = 0; list != nullptr && i < list->count_props; ++i) {
    const auto property = owned<drmModeFreeProperty>(drmModeGetProperty(fd_, list->props[i]));
    if (property == nullptr) continue;
    properties[property->name] = {.id = property->prop_id,
                                  .value = list->prop_values[i],
                                  .blob = (property->flags & DRM_MODE_PROP_BLOB) != 0};
  }
  return properties;
}

void DrmCard::change(std::vector<Setting>& settings, std::uint32_t object, const Properties& properties,
                     const char* name, std::uint64_t value) {
  const auto found = properties.find(name);
  if (found == properties.end()) return;
  const Property& property = found->second;
  settings.push_back({object, property.id, value});
  const auto [before, first] = before_.try_emplace({object, property.id}, property.value);
  if (!first || !property.blob) return;
  // Another program's blob vanishes with its last use; a copy does not.
  const auto blob =
      owned<drmModeFreePropertyBlob>(drmModeGetPropertyBlob(fd_, static_cast<std::uint32_t>(property.value)));
  std::uint32_t copy = 0;
  if (blob != nullptr) drmModeCreatePropertyBlob(fd_, blob->data, blob->length, &copy);
  before->second = copy;
}

absl::StatusOr<DrmCard::Pipe> DrmCard::claim(const Connector& connector, int bits) {
  Pipe pipe;
  size_t index = 0;
  for (size_t i = 0; i < crtcs_.size(); ++i) {
    if ((connector.possible_crtcs >> i & 1) == 0 || claimed_.contains(crtcs_[i])) continue;
    if (pipe.crtc != 0 && crtcs_[i] != connector.current_crtc) continue;
    pipe.crtc = crtcs_[i], index = i;
  }
  const auto planes = owned<drmModeFreePlaneResources>(drmModeGetPlaneResources(fd_));
  for (std::uint32_t i = 0; pipe.crtc != 0 && planes != nullptr && i < planes->count_planes; ++i) {
    const auto plane = owned<drmModeFreePlane>(drmModeGetPlane(fd_, planes->planes[i]));
    if (plane == nullptr) continue;
    const auto properties = properties_of(plane->plane_id);
    const auto type = properties.find("type"), framebuffer = properties.find("FB_ID");
    if (type == properties.end() || framebuffer == properties.end()) continue;
    if (type->second.value != DRM_PLANE_TYPE_PRIMARY || (plane->possible_crtcs >> index & 1) == 0 ||
        claimed_.contains(plane->plane_id))
      continue;
    const std::span formats(plane->formats, plane->count_formats);
    std::vector<int> taken;
    for (const int each : {8, 10}) {
      if (std::find(formats.begin(), formats.end(), format_of(each)) != formats.end()) taken.push_back(each);
    }
    if (std::find(taken.begin(), taken.end(), bits) == taken.end()) {
      return absl::FailedPreconditionError(
          fmt::format("{} does not support pictures with codes of {} bits for {}; available: {}", name_, bits,
                      connector.name, fmt::join(taken, ", ")));
    }
    pipe.bits = bits;
    pipe.plane = plane->plane_id;
    pipe.framebuffer_property = framebuffer->second.id;
    break;
  }
  if (pipe.plane == 0) {
    return absl::FailedPreconditionError(
        fmt::format("{} cannot drive {} in addition to the monitors named before it", name_, connector.name));
  }
  claimed_.insert({pipe.crtc, pipe.plane});
  return pipe;
}

absl::StatusOr<DrmCard::Framebuffer> DrmCard::make_framebuffer(const Pipe& pipe, int width_px,
                                                               int height_px) {
  const auto width = static_cast<std::uint32_t>(width_px), height = static_cast<std::uint32_t>(height_px);
  std::uint32_t handle = 0, stride = 0;
  std::uint64_t bytes = 0, offset = 0;
  Framebuffer made;
  void* mapped = MAP_FAILED;
  if (drmModeCreateDumbBuffer(fd_, width, height, 32, 0, &handle, &stride, &bytes) == 0) {
    const std::array<std::uint32_t, 4> handles{handle}, strides{stride}, offsets{};
    if (drmModeAddFB2(fd_, width, height, format_of(pipe.bits), handles.data(), strides.data(),
                      offsets.data(), &made.id, 0) == 0 &&
        drmModeMapDumbBuffer(fd_, handle, &offset) == 0) {
      mapped = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, static_cast<off_t>(offset));
    }
  }
  if (mapped == MAP_FAILED) {
    return absl::ResourceExhaustedError(fmt::format("{} has no memory for a picture of {} x {} px: {}", name_,
                                                    width_px, height_px, std::strerror(errno)));
  }
  std::memset(mapped, 0, bytes);
  memory_.push_back({.mapped = mapped, .bytes = bytes});
  made.pixels = static_cast<std::uint8_t*>(mapped);
  made.stride_bytes = stride;
  return made;
}

absl::Status DrmCard::turn_off() {
  std::vector<Setting> settings;
  for (const Connector& connector : connectors_)
    change(settings, connector.id, properties_of(connector.id), "CRTC_ID", 0);
  for (const std::uint32_t crtc : crtcs_) {
    const Properties properties = properties_of(crtc);
    for (const char* property : {"ACTIVE", "MODE_ID"}) change(settings, crtc, properties, property, 0);
  }
  const auto planes = owned<drmModeFreePlaneResources>(drmModeGetPlaneResources(fd_));
  for (std::uint32_t i = 0; planes != nullptr && i < planes->count_planes; ++i) {
    const Properties properties = properties_of(planes->planes[i]);
    for (const char* property : {"FB_ID", "CRTC_ID"})
      change(settings, planes->planes[i], properties, property, 0);
  }
  return commit(settings, DRM_MODE_ATOMIC_ALLOW_MODESET, 0);
}

absl::Status DrmCard::set(const Connector& connector, const Pipe& pipe, const drmModeModeInfo& mode,
                          const Framebuffer& framebuffer) {
  if (drmIsMaster(fd_) == 0) {
    return absl::FailedPreconditionError(
        fmt::format("another program, perhaps a desktop, holds {}; stop it, or show pictures through it "
                    "(--backend x11)",
                    name_));
  }
  absl::Status status = before_.empty() ? turn_off() : absl::OkStatus();
  if (status.ok()) {
    std::uint32_t timings = 0;
    drmModeCreatePropertyBlob(fd_, &mode, sizeof(mode), &timings);
    std::vector<Setting> settings;
    const Properties plug = properties_of(connector.id);
    change(settings, connector.id, plug, "CRTC_ID", pipe.crtc);
    // Some drivers send only 8 bits to the monitor by default.
    const auto max_bits = plug.find("max bpc");
    if (max_bits != plug.end() && max_bits->second.value < static_cast<std::uint64_t>(pipe.bits))
      change(settings, connector.id, plug, "max bpc", static_cast<std::uint64_t>(pipe.bits));
    const Properties crtc = properties_of(pipe.crtc), plane = properties_of(pipe.plane);
    change(settings, pipe.crtc, crtc, "MODE_ID", timings);
    change(settings, pipe.crtc, crtc, "ACTIVE", 1);
    // No correction between codes and signal, and a fixed refresh rate.
    for (const char* property : {"DEGAMMA_LUT", "CTM", "GAMMA_LUT", "VRR_ENABLED"})
      change(settings, pipe.crtc, crtc, property, 0);
    change(settings, pipe.plane, plane, "CRTC_ID", pipe.crtc);
    change(settings, pipe.plane, plane, "FB_ID", framebuffer.id);
    for (const char* corner : {"SRC_X", "SRC_Y", "CRTC_X", "CRTC_Y"})
      change(settings, pipe.plane, plane, corner, 0);
    change(settings, pipe.plane, plane, "SRC_W", std::uint64_t{mode.hdisplay} << 16);  // 16.16 fixed point
    change(settings, pipe.plane, plane, "SRC_H", std::uint64_t{mode.vdisplay} << 16);
    change(settings, pipe.plane, plane, "CRTC_W", mode.hdisplay);
    change(settings, pipe.plane, plane, "CRTC_H", mode.vdisplay);
    status = commit(settings, DRM_MODE_ATOMIC_ALLOW_MODESET, 0);
  }
  if (status.ok()) return status;
  return absl::FailedPreconditionError(fmt::format("{} does not show {} x {} px at {:.2f} Hz on {}: {}",
                                                   name_, mode.hdisplay, mode.vdisplay, refresh_hz_of(mode),
                                                   connector.name, std::string(status.message())));
}

absl::Status DrmCard::commit(const std::vector<Setting>& settings, std::uint32_t flags,
                             std::uint64_t serial) const {
  const auto request = owned<drmModeAtomicFree>(drmModeAtomicAlloc());
  for (const Setting& each : settings)
    drmModeAtomicAddProperty(request.get(), each.object, each.property, each.value);
  // The kernel only passes it back.
  void* const user_data = reinterpret_cast<void*>(static_cast<std::uintptr_t>(serial));
  const int error = drmModeAtomicCommit(fd_, request.get(), flags, user_data);
  return error == 0 ? absl::OkStatus() : absl::UnavailableError(std::strerror(-error));
}

absl::StatusOr<DrmCard::Refresh> DrmCard::last_refresh(const Pipe& pipe) const {
  std::uint64_t number = 0, start_ns = 0;
  if (drmCrtcGetSequence(fd_, pipe.crtc, &number, &start_ns) != 0)
    return absl::UnavailableError(std::strerror(errno));
  return Refresh{.number = number, .start = nanoseconds(start_ns)};
}

absl::Status DrmCard::ask_for(const Pipe& pipe, std::uint64_t refresh, std::uint64_t serial) {
  if (drmCrtcQueueSequence(fd_, pipe.crtc, 0, refresh, nullptr, serial) != 0)
    return absl::UnavailableError(std::strerror(errno));
  return absl::OkStatus();
}

absl::Status DrmCard::flip(const Pipe& pipe, const Framebuffer& framebuffer, std::uint64_t serial) {
  return commit({{pipe.plane, pipe.framebuffer_property, framebuffer.id}},
                DRM_MODE_ATOMIC_NONBLOCK | DRM_MODE_PAGE_FLIP_EVENT, serial);
}

absl::StatusOr<std::vector<DrmCard::Event>> DrmCard::read_events() {
  std::vector<Event> events;
  alignas(drm_event_crtc_sequence) std::array<char, 4096> buffer;
  const ssize_t read = ::read(fd_, buffer.data(), buffer.size());
  if (read < 0 && errno != EAGAIN && errno != EINTR)
    return absl::UnavailableError(fmt::format("{} has gone away: {}", name_, std::strerror(errno)));
  drm_event head{};
  for (size_t at = 0; read > 0 && at + sizeof(head) <= static_cast<size_t>(read); at += head.length) {
    std::memcpy(&head, buffer.data() + at, sizeof(head));
    if (head.type == DRM_EVENT_FLIP_COMPLETE) {
      drm_event_vblank flip{};
      std::memcpy(&flip, buffer.data() + at, sizeof(flip));
      events.push_back(
          {.serial = flip.user_data,
           .refresh_start = std::chrono::seconds(flip.tv_sec) + std::chrono::microseconds(flip.tv_usec)});
    } else if (head.type == DRM_EVENT_CRTC_SEQUENCE) {
      drm_event_crtc_sequence sequence{};
      std::memcpy(&sequence, buffer.data() + at, sizeof(sequence));
      events.push_back({.serial = sequence.user_data, .refresh_start = nanoseconds(sequence.time_ns)});
    }
  }
  return events;
}

}  // namespace glasswing
