// Gives the virtual USB bus of vhci-hcd a firmware node, from which libcamera derives the name of a USB
// camera. The bus of a real machine has one from its ACPI tables.
#include <linux/device.h>
#include <linux/module.h>
#include <linux/platform_device.h>

static struct device* bus;

static ssize_t path_show(struct device* device, struct device_attribute* attribute, char* text) {
  return sysfs_emit(text, "\\_SB.PCI0.VHCI\n");
}
static DEVICE_ATTR_RO(path);

static struct attribute* attributes[] = {&dev_attr_path.attr, NULL};
static const struct attribute_group node = {.name = "firmware_node", .attrs = attributes};

static int __init add_node(void) {
  int error;
  bus = bus_find_device_by_name(&platform_bus_type, NULL, "vhci_hcd.0");
  if (!bus) return -ENODEV;
  error = sysfs_create_group(&bus->kobj, &node);
  if (error) put_device(bus);
  return error;
}

static void __exit remove_node(void) {
  sysfs_remove_group(&bus->kobj, &node);
  put_device(bus);
}

module_init(add_node);
module_exit(remove_node);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("A firmware node for vhci_hcd.0");
