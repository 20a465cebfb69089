// An access control plugin that lets its own participant do whatever it likes: the client of somebody who has changed the client. What it may do is then only
// what others let it do. In C, because the library's own header is no C++.
#define _GNU_SOURCE
#include <dds/dds.h>
#include <dds/security/dds_security_api.h>
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

typedef int (*Init)(const char*, void**, struct ddsi_domaingv*);
typedef int (*Finalize)(void*);

// The real plugin, in Debian's private folder beside the library or where the loader finds it.
static void* real_plugin(void) {
  static void* handle = NULL;
  if (handle) return handle;
  Dl_info library;
  char path[4096];
  if (dladdr((void*)&dds_create_participant, &library) && strrchr(library.dli_fname, '/')) {
    const int folder = (int)(strrchr(library.dli_fname, '/') - library.dli_fname);
    snprintf(path, sizeof path, "%.*s/libddsc0debian/libdds_security_ac.so", folder, library.dli_fname);
    handle = dlopen(path, RTLD_NOW);
  }
  if (!handle) handle = dlopen("libdds_security_ac.so", RTLD_NOW);
  return handle;
}

static DDS_Security_boolean writer_is_fine(dds_security_access_control* plugin, const DDS_Security_PermissionsHandle permissions,
                                           const DDS_Security_DomainId domain, const char* topic, const DDS_Security_Qos* qos,
                                           const DDS_Security_PartitionQosPolicy* partition, const DDS_Security_DataTags* tags,
                                           DDS_Security_SecurityException* why) {
  (void)plugin, (void)permissions, (void)domain, (void)topic, (void)qos, (void)partition, (void)tags, (void)why;
  return true;
}

static DDS_Security_boolean topic_is_fine(dds_security_access_control* plugin, const DDS_Security_PermissionsHandle permissions,
                                          const DDS_Security_DomainId domain, const char* topic, const DDS_Security_Qos* qos,
                                          DDS_Security_SecurityException* why) {
  (void)plugin, (void)permissions, (void)domain, (void)topic, (void)qos, (void)why;
  return true;
}

int init_access_control(const char* argument, void** context, struct ddsi_domaingv* domain) {
  const Init init = real_plugin() ? (Init)dlsym(real_plugin(), "init_access_control") : NULL;
  if (!init) return -1;
  const int result = init(argument, context, domain);
  if (result != 0) return result;
  dds_security_access_control* plugin = *context;
  plugin->check_create_datawriter = writer_is_fine;
  plugin->check_create_datareader = writer_is_fine;
  plugin->check_create_topic = topic_is_fine;
  return result;
}

int finalize_access_control(void* context) {
  const Finalize finalize = real_plugin() ? (Finalize)dlsym(real_plugin(), "finalize_access_control") : NULL;
  return finalize ? finalize(context) : -1;
}
