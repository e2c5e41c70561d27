//! The functions of the C interface: pointers in, [`crate::runtime`] asked, pointers out. All `unsafe` is here.
//!
//! Each function has the signature that `openxr_sys::pfn` gives it, which the compiler compares in [`function`]. None
//! panics outward: [`guarded`] turns that into a code.

mod input;

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};
use std::{mem, slice};

use openxr_sys::{
    CURRENT_API_VERSION, EventDataBuffer, EventDataInstanceLossPending, EventDataInteractionProfileChanged,
    EventDataReferenceSpaceChangePending, EventDataSessionStateChanged, ExtensionProperties, FALSE,
    FormFactor, Handle, Instance, InstanceCreateInfo, InstanceProperties, NegotiateLoaderInfo,
    NegotiateRuntimeRequest, Posef, ReferenceSpaceType, Result as Code, Session, SessionBeginInfo,
    SessionCreateInfo, SystemGetInfo, SystemId, Version, pfn,
};

use self::input::{
    attach, create_action, create_action_set, create_action_space, create_hand, create_reference_space,
    destroy_action, destroy_action_set, destroy_hand, destroy_space, locate_joints, locate_space,
    path_to_string, profile, reference_spaces, string_to_path, suggest, sync_actions, time_of, timespec_of,
};
use crate::runtime::{Outcome, Runtime, Told, offered};
use crate::service::Service;

const NAME: &[u8] = b"TEGA's emulated runtime";
const VERSION: Version = Version::new(1, 0, 0);
const SYSTEM: u64 = 1;
const NS: i64 = 1_000_000_000;

/// The one instance that there can be.
static RUNTIME: Mutex<Option<Runtime>> = Mutex::new(None);

/// Runs what a function does; a panic is a failure of the runtime.
fn guarded(act: impl FnOnce() -> Outcome<()>) -> Code {
    match catch_unwind(AssertUnwindSafe(act)) {
        Ok(Ok(())) => Code::SUCCESS,
        Ok(Err(code)) => code,
        Err(_) => Code::ERROR_RUNTIME_FAILURE,
    }
}

/// Runs what a function does with the instance.
fn with(act: impl FnOnce(&mut Runtime) -> Outcome<()>) -> Code {
    guarded(|| {
        let mut runtime = RUNTIME.lock().unwrap_or_else(PoisonError::into_inner);
        runtime.as_mut().ok_or(Code::ERROR_HANDLE_INVALID).and_then(act)
    })
}

/// # Safety
/// The pointer is null or points to a `T` that stays as it is meanwhile.
unsafe fn seen<'a, T>(pointer: *const T) -> Outcome<&'a T> {
    // SAFETY: by this function's own contract.
    unsafe { pointer.as_ref() }.ok_or(Code::ERROR_VALIDATION_FAILURE)
}

/// # Safety
/// The pointer is null or points to room for a `T`.
unsafe fn put<T>(pointer: *mut T, value: T) -> Outcome<()> {
    if pointer.is_null() {
        return Err(Code::ERROR_VALIDATION_FAILURE);
    }
    // SAFETY: not null, and by this function's own contract.
    unsafe { pointer.write(value) };
    Ok(())
}

/// # Safety
/// The pointer is null or points to so many `T`.
unsafe fn many<'a, T>(pointer: *const T, count: u32) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    if pointer.is_null() {
        return Err(Code::ERROR_VALIDATION_FAILURE);
    }
    // SAFETY: not null, and by this function's own contract.
    Ok(unsafe { slice::from_raw_parts(pointer, count as usize) })
}

/// # Safety
/// The pointer is null or points to a text that ends with a zero.
unsafe fn text<'a>(pointer: *const c_char) -> Outcome<&'a str> {
    if pointer.is_null() {
        return Err(Code::ERROR_VALIDATION_FAILURE);
    }
    // SAFETY: not null, and by this function's own contract.
    unsafe { CStr::from_ptr(pointer) }.to_str().map_err(|_| Code::ERROR_VALIDATION_FAILURE)
}

/// `OpenXR`'s two calls: one without room asks how much there is, one with room gets it.
///
/// # Safety
/// `count` is null or points to a number, `room` is null or has room for `capacity` items.
unsafe fn fill<T: Copy>(capacity: u32, count: *mut u32, room: *mut T, items: &[T]) -> Outcome<()> {
    // SAFETY: by this function's own contract.
    unsafe { put(count, items.len() as u32) }?;
    if capacity == 0 {
        return Ok(());
    }
    if (capacity as usize) < items.len() {
        return Err(Code::ERROR_SIZE_INSUFFICIENT);
    }
    for (at, &item) in items.iter().enumerate() {
        // SAFETY: `at` is below the capacity, for which there is room.
        unsafe { put(room.wrapping_add(at), item) }?;
    }
    Ok(())
}

/// Writes a text into a field of a fixed size, and the zero behind it.
fn field<const N: usize>(text: &[u8]) -> [c_char; N] {
    let mut field = [0; N];
    for (to, &from) in field.iter_mut().zip(text.iter().take(N - 1)) {
        *to = from as c_char;
    }
    field
}

/// What the loader asks first.
///
/// # Safety
/// The pointers are null or point to the loader's structures.
#[unsafe(export_name = "xrNegotiateLoaderRuntimeInterface")]
pub unsafe extern "system" fn negotiate(
    loader: *const NegotiateLoaderInfo,
    request: *mut NegotiateRuntimeRequest,
) -> Code {
    guarded(|| {
        // SAFETY: the loader passes its own structures; `request` is its own and nobody else's meanwhile.
        let (loader, request) = unsafe { (seen(loader)?, request.as_mut()) };
        let request = request.ok_or(Code::ERROR_INITIALIZATION_FAILED)?;
        if loader.struct_type != NegotiateLoaderInfo::TYPE || loader.min_interface_version > 1 {
            return Err(Code::ERROR_INITIALIZATION_FAILED);
        }
        request.runtime_interface_version = 1;
        request.runtime_api_version = CURRENT_API_VERSION;
        request.get_instance_proc_addr = Some(get_instance_proc_addr);
        Ok(())
    })
}

/// One function without its type, as `xrGetInstanceProcAddr` gives them out; its type is compared before.
macro_rules! function {
    ($function:ident as $Type:ident) => {{
        let typed: pfn::$Type = $function;
        // SAFETY: pointers to functions have one size; the caller turns it back into the type of its name.
        Some(unsafe { mem::transmute::<pfn::$Type, pfn::VoidFunction>(typed) })
    }};
}

/// Finds a function by its name.
fn function(name: &str) -> Option<pfn::VoidFunction> {
    match name {
        "xrGetInstanceProcAddr" => function!(get_instance_proc_addr as GetInstanceProcAddr),
        "xrEnumerateInstanceExtensionProperties" => {
            function!(extensions as EnumerateInstanceExtensionProperties)
        }
        "xrCreateInstance" => function!(create_instance as CreateInstance),
        "xrDestroyInstance" => function!(destroy_instance as DestroyInstance),
        "xrGetInstanceProperties" => function!(instance_properties as GetInstanceProperties),
        "xrResultToString" => function!(result_to_string as ResultToString),
        "xrPollEvent" => function!(poll_event as PollEvent),
        "xrGetSystem" => function!(get_system as GetSystem),
        "xrCreateSession" => function!(create_session as CreateSession),
        "xrDestroySession" => function!(destroy_session as DestroySession),
        "xrBeginSession" => function!(begin_session as BeginSession),
        "xrEndSession" => function!(end_session as EndSession),
        "xrRequestExitSession" => function!(request_exit as RequestExitSession),
        "xrEnumerateReferenceSpaces" => function!(reference_spaces as EnumerateReferenceSpaces),
        "xrCreateReferenceSpace" => function!(create_reference_space as CreateReferenceSpace),
        "xrCreateActionSpace" => function!(create_action_space as CreateActionSpace),
        "xrDestroySpace" => function!(destroy_space as DestroySpace),
        "xrLocateSpace" => function!(locate_space as LocateSpace),
        "xrStringToPath" => function!(string_to_path as StringToPath),
        "xrPathToString" => function!(path_to_string as PathToString),
        "xrCreateActionSet" => function!(create_action_set as CreateActionSet),
        "xrDestroyActionSet" => function!(destroy_action_set as DestroyActionSet),
        "xrCreateAction" => function!(create_action as CreateAction),
        "xrDestroyAction" => function!(destroy_action as DestroyAction),
        "xrSuggestInteractionProfileBindings" => function!(suggest as SuggestInteractionProfileBindings),
        "xrAttachSessionActionSets" => function!(attach as AttachSessionActionSets),
        "xrGetCurrentInteractionProfile" => function!(profile as GetCurrentInteractionProfile),
        "xrSyncActions" => function!(sync_actions as SyncActions),
        "xrConvertTimespecTimeToTimeKHR" => function!(time_of as ConvertTimespecTimeToTimeKHR),
        "xrConvertTimeToTimespecTimeKHR" => function!(timespec_of as ConvertTimeToTimespecTimeKHR),
        "xrCreateHandTrackerEXT" => function!(create_hand as CreateHandTrackerEXT),
        "xrDestroyHandTrackerEXT" => function!(destroy_hand as DestroyHandTrackerEXT),
        "xrLocateHandJointsEXT" => function!(locate_joints as LocateHandJointsEXT),
        _ => None,
    }
}

// What follows is called by the application, through the loader, with the pointers that OpenXR's specification demands
// of each: null, or one to a structure of the parameter's type, of which it says itself whether it is read or written.

unsafe extern "system" fn get_instance_proc_addr(
    _instance: Instance,
    name: *const c_char,
    out: *mut Option<pfn::VoidFunction>,
) -> Code {
    guarded(|| {
        // SAFETY: a name and room for a function, as the specification demands.
        let found = function(unsafe { text(name) }?);
        // SAFETY: as above.
        unsafe { put(out, found) }?;
        found.map(|_| ()).ok_or(Code::ERROR_FUNCTION_UNSUPPORTED)
    })
}

unsafe extern "system" fn extensions(
    _layer: *const c_char,
    capacity: u32,
    count: *mut u32,
    room: *mut ExtensionProperties,
) -> Code {
    guarded(|| {
        let mut service = Service::connect().ok_or(Code::ERROR_RUNTIME_UNAVAILABLE)?;
        let there: Vec<_> = offered(&mut service)?
            .iter()
            .map(|name| ExtensionProperties {
                ty: ExtensionProperties::TYPE,
                next: std::ptr::null_mut(),
                extension_name: field(name.as_bytes()),
                extension_version: 1,
            })
            .collect();
        // SAFETY: a number and room for so many, as the specification demands.
        unsafe { fill(capacity, count, room, &there) }
    })
}

unsafe extern "system" fn create_instance(info: *const InstanceCreateInfo, out: *mut Instance) -> Code {
    guarded(|| {
        // SAFETY: a structure with so many names, as the specification demands.
        let names =
            unsafe { many(seen(info)?.enabled_extension_names, seen(info)?.enabled_extension_count) }?;
        let wanted: Outcome<Vec<_>> = names
            .iter()
            // SAFETY: each of them is a text.
            .map(|&name| unsafe { text(name) }.map(str::to_owned))
            .collect();
        let mut runtime = RUNTIME.lock().unwrap_or_else(PoisonError::into_inner);
        if runtime.is_some() {
            return Err(Code::ERROR_LIMIT_REACHED);
        }
        let made = runtime.insert(Runtime::new(wanted?)?);
        // SAFETY: room for a handle.
        unsafe { put(out, Instance::from_raw(made.handle())) }
    })
}

unsafe extern "system" fn destroy_instance(_instance: Instance) -> Code {
    guarded(|| {
        let mut runtime = RUNTIME.lock().unwrap_or_else(PoisonError::into_inner);
        runtime.take().map(|_| ()).ok_or(Code::ERROR_HANDLE_INVALID)
    })
}

unsafe extern "system" fn instance_properties(_instance: Instance, out: *mut InstanceProperties) -> Code {
    with(|_| {
        let said = InstanceProperties {
            ty: InstanceProperties::TYPE,
            next: std::ptr::null_mut(),
            runtime_version: VERSION,
            runtime_name: field(NAME),
        };
        // SAFETY: room for the structure.
        unsafe { put(out, said) }
    })
}

unsafe extern "system" fn result_to_string(_instance: Instance, value: Code, out: *mut c_char) -> Code {
    guarded(|| {
        let name: [c_char; openxr_sys::MAX_RESULT_STRING_SIZE] = field(format!("XR_{value:?}").as_bytes());
        // SAFETY: room for a text of that size.
        unsafe { put(out.cast(), name) }
    })
}

unsafe extern "system" fn poll_event(_instance: Instance, out: *mut EventDataBuffer) -> Code {
    with(|runtime| {
        let (told, time) = runtime.event()?;
        let (session, next) = (Session::from_raw(1), std::ptr::null());
        // SAFETY: room for the largest of all events, aligned as they are.
        unsafe {
            match told {
                Told::State(state) => {
                    let ty = EventDataSessionStateChanged::TYPE;
                    put(out.cast(), EventDataSessionStateChanged { ty, next, session, state, time })
                }
                Told::Recentred => {
                    let event = EventDataReferenceSpaceChangePending {
                        ty: EventDataReferenceSpaceChangePending::TYPE,
                        next,
                        session,
                        reference_space_type: ReferenceSpaceType::LOCAL,
                        change_time: time,
                        pose_valid: FALSE,
                        pose_in_previous_space: Posef::IDENTITY,
                    };
                    put(out.cast(), event)
                }
                Told::Profile => {
                    let ty = EventDataInteractionProfileChanged::TYPE;
                    put(out.cast(), EventDataInteractionProfileChanged { ty, next, session })
                }
                Told::InstanceLoss => {
                    let ty = EventDataInstanceLossPending::TYPE;
                    put(out.cast(), EventDataInstanceLossPending { ty, next, loss_time: time })
                }
            }
        }
    })
}

unsafe extern "system" fn get_system(
    _instance: Instance,
    info: *const SystemGetInfo,
    out: *mut SystemId,
) -> Code {
    with(|_| {
        // SAFETY: a structure and room for a number.
        unsafe {
            if seen(info)?.form_factor != FormFactor::HEAD_MOUNTED_DISPLAY {
                return Err(Code::ERROR_FORM_FACTOR_UNSUPPORTED);
            }
            put(out, SystemId::from_raw(SYSTEM))
        }
    })
}

unsafe extern "system" fn create_session(
    _instance: Instance,
    info: *const SessionCreateInfo,
    out: *mut Session,
) -> Code {
    with(|runtime| {
        // SAFETY: a structure and room for a handle.
        unsafe {
            if seen(info)?.system_id != SystemId::from_raw(SYSTEM) {
                return Err(Code::ERROR_SYSTEM_INVALID);
            }
            put(out, Session::from_raw(runtime.create_session()?))
        }
    })
}

unsafe extern "system" fn destroy_session(_session: Session) -> Code {
    with(|runtime| {
        runtime.destroy_session();
        Ok(())
    })
}

unsafe extern "system" fn begin_session(_session: Session, _info: *const SessionBeginInfo) -> Code {
    with(Runtime::begin_session)
}

unsafe extern "system" fn end_session(_session: Session) -> Code {
    with(Runtime::end_session)
}

unsafe extern "system" fn request_exit(_session: Session) -> Code {
    with(Runtime::request_exit)
}
