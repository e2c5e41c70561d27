//! Spaces, paths, actions, times and hands of the C interface.
//!
//! Called by the application, through the loader, with the pointers that the specification demands of each.

use std::ffi::c_char;
use std::slice;

use libc::timespec;
use openxr_sys::{
    Action, ActionCreateInfo, ActionSet, ActionSetCreateInfo, ActionSpaceCreateInfo, ActionsSyncInfo,
    HandEXT, HandJointEXT, HandJointLocationsEXT, HandJointsLocateInfoEXT, HandTrackerCreateInfoEXT,
    HandTrackerEXT, Handle, Instance, InteractionProfileState, InteractionProfileSuggestedBinding, Path,
    ReferenceSpaceCreateInfo, ReferenceSpaceType, Result as Code, Session, SessionActionSetsAttachInfo,
    Space, SpaceLocation, Time,
};

use super::{NS, fill, many, put, seen, text, with};
use crate::runtime::{Place, Runtime, from_monotonic_ns, to_monotonic_ns};

pub(super) unsafe extern "system" fn reference_spaces(
    _session: Session,
    capacity: u32,
    count: *mut u32,
    room: *mut ReferenceSpaceType,
) -> Code {
    // SAFETY: a number and room for so many.
    with(|_| unsafe { fill(capacity, count, room, &[ReferenceSpaceType::LOCAL, ReferenceSpaceType::STAGE]) })
}

pub(super) unsafe extern "system" fn create_reference_space(
    _session: Session,
    info: *const ReferenceSpaceCreateInfo,
    out: *mut Space,
) -> Code {
    with(|runtime| {
        // SAFETY: a structure.
        let name = match unsafe { seen(info) }?.reference_space_type {
            ReferenceSpaceType::LOCAL => "local",
            ReferenceSpaceType::STAGE => "stage",
            _ => return Err(Code::ERROR_REFERENCE_SPACE_UNSUPPORTED),
        };
        // SAFETY: room for a handle.
        unsafe { put(out, Space::from_raw(runtime.create_space(Place::Reference(name)))) }
    })
}

pub(super) unsafe extern "system" fn create_action_space(
    _session: Session,
    info: *const ActionSpaceCreateInfo,
    out: *mut Space,
) -> Code {
    with(|runtime| {
        // SAFETY: a structure.
        let info = unsafe { seen(info) }?;
        let user = runtime.path_text(info.subaction_path.into_raw())?.to_owned();
        let place = Place::Action { action: info.action.into_raw(), user };
        // SAFETY: room for a handle.
        unsafe { put(out, Space::from_raw(runtime.create_space(place))) }
    })
}

pub(super) unsafe extern "system" fn destroy_space(_space: Space) -> Code {
    with(|_| Ok(()))
}

pub(super) unsafe extern "system" fn locate_space(
    space: Space,
    base: Space,
    time: Time,
    out: *mut SpaceLocation,
) -> Code {
    with(|runtime| {
        let found = runtime.locate(space.into_raw(), base.into_raw(), time)?;
        // SAFETY: the application's structure, whose head stays as it is.
        let out = unsafe { out.as_mut() }.ok_or(Code::ERROR_VALIDATION_FAILURE)?;
        (out.location_flags, out.pose) = (found.flags, found.pose);
        Ok(())
    })
}

pub(super) unsafe extern "system" fn string_to_path(
    _instance: Instance,
    name: *const c_char,
    out: *mut Path,
) -> Code {
    // SAFETY: a text and room for a number.
    with(|runtime| unsafe { put(out, Path::from_raw(runtime.path(text(name)?)?)) })
}

pub(super) unsafe extern "system" fn path_to_string(
    _instance: Instance,
    path: Path,
    capacity: u32,
    count: *mut u32,
    room: *mut c_char,
) -> Code {
    with(|runtime| {
        let name = runtime.path_text(path.into_raw())?.bytes().chain([0]);
        let name: Vec<_> = name.map(|byte| byte as c_char).collect();
        // SAFETY: a number and room for so many.
        unsafe { fill(capacity, count, room, &name) }
    })
}

pub(super) unsafe extern "system" fn create_action_set(
    _instance: Instance,
    _info: *const ActionSetCreateInfo,
    out: *mut ActionSet,
) -> Code {
    // SAFETY: room for a handle.
    with(|runtime| unsafe { put(out, ActionSet::from_raw(runtime.handle())) })
}

pub(super) unsafe extern "system" fn destroy_action_set(_set: ActionSet) -> Code {
    with(|_| Ok(()))
}

pub(super) unsafe extern "system" fn create_action(
    _set: ActionSet,
    _info: *const ActionCreateInfo,
    out: *mut Action,
) -> Code {
    // SAFETY: room for a handle.
    with(|runtime| unsafe { put(out, Action::from_raw(runtime.handle())) })
}

pub(super) unsafe extern "system" fn destroy_action(_action: Action) -> Code {
    with(|_| Ok(()))
}

pub(super) unsafe extern "system" fn suggest(
    _instance: Instance,
    info: *const InteractionProfileSuggestedBinding,
) -> Code {
    with(|runtime| {
        // SAFETY: a structure with so many bindings.
        let (info, bindings) = unsafe {
            let info = seen(info)?;
            (info, many(info.suggested_bindings, info.count_suggested_bindings)?)
        };
        let bindings: Vec<_> = bindings.iter().map(|b| (b.action.into_raw(), b.binding.into_raw())).collect();
        runtime.suggest(info.interaction_profile.into_raw(), &bindings)
    })
}

pub(super) unsafe extern "system" fn attach(
    _session: Session,
    _info: *const SessionActionSetsAttachInfo,
) -> Code {
    with(Runtime::attach)
}

pub(super) unsafe extern "system" fn profile(
    _session: Session,
    user: Path,
    out: *mut InteractionProfileState,
) -> Code {
    with(|runtime| {
        let named = runtime.profile(user.into_raw())?;
        // SAFETY: the application's structure, whose head stays as it is.
        let out = unsafe { out.as_mut() }.ok_or(Code::ERROR_VALIDATION_FAILURE)?;
        out.interaction_profile = Path::from_raw(named);
        Ok(())
    })
}

pub(super) unsafe extern "system" fn sync_actions(_session: Session, _info: *const ActionsSyncInfo) -> Code {
    with(Runtime::sync)
}

pub(super) unsafe extern "system" fn time_of(
    _instance: Instance,
    from: *const timespec,
    out: *mut Time,
) -> Code {
    with(|_| {
        // SAFETY: a structure.
        let from = unsafe { seen(from) }?;
        let ns = from.tv_sec.saturating_mul(NS).saturating_add(from.tv_nsec);
        // SAFETY: room for a number.
        unsafe { put(out, from_monotonic_ns(ns)) }
    })
}

pub(super) unsafe extern "system" fn timespec_of(
    _instance: Instance,
    time: Time,
    out: *mut timespec,
) -> Code {
    with(|_| {
        let ns = to_monotonic_ns(time)?;
        // SAFETY: room for the structure.
        unsafe { put(out, timespec { tv_sec: ns.div_euclid(NS), tv_nsec: ns.rem_euclid(NS) }) }
    })
}

pub(super) unsafe extern "system" fn create_hand(
    _session: Session,
    info: *const HandTrackerCreateInfoEXT,
    out: *mut HandTrackerEXT,
) -> Code {
    with(|runtime| {
        // SAFETY: a structure.
        let user = match unsafe { seen(info) }?.hand {
            HandEXT::LEFT => "/user/hand/left",
            _ => "/user/hand/right",
        };
        // SAFETY: room for a handle.
        unsafe { put(out, HandTrackerEXT::from_raw(runtime.create_hand(user)?)) }
    })
}

pub(super) unsafe extern "system" fn destroy_hand(_hand: HandTrackerEXT) -> Code {
    with(|_| Ok(()))
}

pub(super) unsafe extern "system" fn locate_joints(
    hand: HandTrackerEXT,
    info: *const HandJointsLocateInfoEXT,
    out: *mut HandJointLocationsEXT,
) -> Code {
    with(|runtime| {
        // SAFETY: structures of the application.
        let (info, out) = unsafe { (seen(info)?, out.as_mut()) };
        let out = out.ok_or(Code::ERROR_VALIDATION_FAILURE)?;
        if out.joint_count as usize != openxr_sys::HAND_JOINT_COUNT_EXT || out.joint_locations.is_null() {
            return Err(Code::ERROR_VALIDATION_FAILURE);
        }
        let wrist = runtime.locate_wrist(hand.into_raw(), info.base_space.into_raw(), info.time)?;
        out.is_active = (!wrist.flags.is_empty()).into();
        // SAFETY: not null, and room for all joints, as the specification demands.
        let joints = unsafe { slice::from_raw_parts_mut(out.joint_locations, out.joint_count as usize) };
        for (number, joint) in joints.iter_mut().enumerate() {
            joint.location_flags = wrist.flags;
            joint.pose = wrist.pose;
            joint.radius = 0.01;
            if number as i32 != HandJointEXT::WRIST.into_raw() {
                // Every other joint is somewhere else: who takes one of them is found out.
                joint.pose.position.y += 1.0 + number as f32;
            }
        }
        Ok(())
    })
}
