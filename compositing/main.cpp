#include "compositing/commands.h"
#include "core/process/freed_memory.h"

int main(int argc, char** argv) {
  glasswing::keep_freed_memory();
  return glasswing::run_compositing(argc, argv);
}
