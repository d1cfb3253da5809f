#include "server/storage/image_name.h"

#include "core/base/checksum.h"

namespace glasswing {

std::string image_name(std::string_view bytes) {
  std::string name = checksum_of(bytes);
  std::erase(name, ':');
  return name;
}

}  // namespace glasswing
